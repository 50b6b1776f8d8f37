"""Oriented points that the host draws and casts while training, in place of stored ones.

Fresh samples ([DDF22] stores its own) are drawn and cast anew in every step: none is seen twice and none needs disk,
but every step pays for its rays. They are rounded as stored ones are, so that both have one distribution.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Int

from ddf.core import checks, storage
from ddf.data import packing, sampling
from ddf.data.batches import category_data, sources
from ddf.data.samples import sample_batch, sample_types
from ddf.geometry import raycast

OPEN_PACKS = 8  # of training meshes, with their ray casting scenes; a shape of another one costs some 20 ms


class Scenes:
    """The training mesh of each shape, in the field frame, ready for ray casting; a few packs are kept open."""

    def __init__(self, folder: Path, ids: Sequence[str]) -> None:
        """Scenes of the given shapes, in their order, from the packs of stage `meshes`.

        Raises:
          InputError: a shape is in no pack, or a pack is damaged; it is named.
        """
        self.paths = storage.shard_files(folder, ".zip", "meshes")
        places = {name: path for path in self.paths for name in storage.load_pack(path)[1]["ids"]}
        missing = [name for name in ids if name not in places]
        if missing:
            raise checks.InputError(f"{folder}: no prepared mesh of shape {missing[0]}; run the meshes stage again")
        self._places = [(places[name], name) for name in ids]
        self._open = functools.lru_cache(maxsize=OPEN_PACKS)(_Pack)

    def __len__(self) -> int:
        return len(self._places)

    def __getitem__(self, index: int, /) -> raycast.Scene:
        path, name = self._places[index]
        return self._open(path).scene(name)


class _Pack:
    """The meshes of one pack, each made a scene when it is first asked for."""

    def __init__(self, path: Path) -> None:
        from ddf.data import mesh_shards  # a step on stored samples runs without its packages

        self._meshes = mesh_shards.read_pack(path).meshes
        self._scenes: dict[str, raycast.Scene] = {}

    def scene(self, name: str) -> raycast.Scene:
        if name not in self._scenes:
            self._scenes[name] = raycast.Scene(self._meshes[name])
        return self._scenes[name]


@dataclass(frozen=True)
class FreshSamples:
    """Samples drawn and cast when they are asked for; a `sources.SampleSource`.

    scenes: of the training shapes, in the order of their set. config: how samples are drawn; its counts are not read.
    """

    scenes: sources.Listed[raycast.Scene]
    config: sampling.SamplesConfig

    def draw(
        self,
        shapes: Int[np.ndarray, "b"],
        counts: Mapping[str, int],
        random: np.random.Generator,
        part: slice = slice(None),
    ) -> sample_batch.SampleBatch:
        """As `category_data.SampleSet.draw`.

        Raises:
          InputError: a mesh leaves the cube, or has no triangle with an area.
        """
        return fresh_batch(self._cast, shapes, counts, random, part)

    def _cast(
        self, shapes: Int[np.ndarray, "b"], counts: Mapping[str, int], seeds: Int[np.ndarray, "b"]
    ) -> dict[str, packing.Samples]:
        cast = []
        for shape, seed in zip(shapes, seeds, strict=True):
            random, sampler = np.random.default_rng(int(seed)), sampling.Sampler(self.scenes[int(shape)], self.config)
            cast.append(sampler.cast(counts, dict.fromkeys(counts, random)).arrays())
        stacked = {name: torch.from_numpy(np.stack([arrays[name] for arrays in cast])) for name in cast[0]}
        return {kind: packing.decode(stacked, kind) for kind in counts}


Cast = Callable[
    [Int[np.ndarray, "b"], Mapping[str, int], Int[np.ndarray, "b"]], dict[str, packing.Samples]
]  # shapes, samples of each type and seeds of the shapes to samples by type


def fresh_batch(
    cast: Cast,
    shapes: Int[np.ndarray, "b"],
    counts: Mapping[str, int],
    random: np.random.Generator,
    part: slice,
    device: torch.device | None = None,
) -> sample_batch.SampleBatch:
    """A batch as of `category_data.SampleSet.draw`, of samples that are cast for it.

    Args:
      device: where `cast` gives them; None for the CPU.
    """
    parts = {"E": category_data.without_truth(len(shapes), counts["E"], random, part, device)}
    seeds = random.integers(2**63, size=len(shapes))[part]
    wanted = {
        kind: [name for name in sample_types.STORED if counts.get(name) and sample_types.base(name) == kind]
        for kind in sample_types.KINDS
    }
    found = cast(shapes[part], {kind: sum(counts[name] for name in names) for kind, names in wanted.items()}, seeds)
    for kind, names in wanted.items():
        ends = np.cumsum([0, *(counts[name] for name in names)])
        for name, start, end in zip(names, ends[:-1], ends[1:], strict=True):
            parts[name] = rows_of(found[kind], slice(start, end))
    order = [name for name in ("E", *sample_types.STORED) if name in parts]
    return category_data.batch_of([parts[name] for name in order], {name: counts[name] for name in order})


def rows_of(samples: packing.Samples, rows: slice) -> packing.Samples:
    """Some samples of every shape."""
    return packing.Samples(
        positions=samples["positions"][:, rows],
        directions=samples["directions"][:, rows],
        depth=samples["depth"][:, rows],
        visible=samples["visible"][:, rows],
        normals=samples["normals"][:, rows],
    )

"""Samples drawn on the host when they are asked for, as a CPU draws them, and cast by a GPU, which keeps the meshes.

What is drawn from lies in a nameless file in the folder for temporary files, for to read a shape's pack of meshes takes
longer than a step.
"""

import os
import tempfile
import weakref
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.core import arrays, storage
from ddf.data import packing, sampling
from ddf.data.batches import host_samples
from ddf.data.samples import draws, sample_batch
from ddf.data.samples.surface import Surface
from ddf.geometry import raycast
from ddf.geometry.gpu import meshes

BYTES = 56  # of a triangle in the file: area, corners, normal


class GroundFile:
    """What samples of meshes are drawn from, in a file without a name (`TMPDIR`); each is read when it is asked for.

    counts: triangles of each mesh.
    """

    def __init__(self, config: sampling.SamplesConfig) -> None:
        self.counts: list[int] = []
        self._config, self._file = config, tempfile.TemporaryFile()
        self._begins: list[int] = []
        self._frames: list[tuple[draws.Box, float]] = []
        weakref.finalize(self, self._file.close)

    def append(self, scene: raycast.Scene) -> None:
        """Add those of a mesh; triangles without an area become points, which no ray meets.

        Raises:
          InputError: as of `sampling.Ground.of`.
        """
        ground = sampling.Ground.of(scene, self._config)
        surface, flat = ground.surface, np.ones(len(scene.mesh.faces), dtype=bool)
        flat[scene.kept] = False
        surface.corners[flat] = surface.corners[flat, :1]
        self._begins.append(self._file.tell())
        with storage.naming(tempfile.gettempdir()):
            for values in (surface.areas, surface.corners, surface.normals):
                self._file.write(np.ascontiguousarray(values).tobytes())
            self._file.flush()
        self.counts.append(len(flat))
        self._frames.append((ground.box, ground.size))

    def __getitem__(self, index: int, /) -> sampling.Ground:
        count = self.counts[index]
        data = os.pread(self._file.fileno(), BYTES * count, self._begins[index])
        areas, rest = np.frombuffer(data, np.float64, count), np.frombuffer(data, np.float32, offset=8 * count)
        surface = Surface(rest[: 9 * count].reshape(-1, 3, 3), rest[9 * count :].reshape(-1, 3), areas)
        return sampling.Ground(surface, *self._frames[index])


@dataclass(frozen=True)
class CastSamples:
    """Samples cast on a device; a `sources.SampleSource`.

    codes: of the normals of both sides of the triangles of `held`, see `sampling.side_codes`.
    """

    held: meshes.Meshes
    grounds: GroundFile
    codes: Int[Tensor, "2 columns 2"]
    config: sampling.SamplesConfig

    def draw(
        self,
        shapes: Int[np.ndarray, "b"],
        counts: Mapping[str, int],
        random: np.random.Generator,
        part: slice = slice(None),
    ) -> sample_batch.SampleBatch:
        """As `training_truth.FreshSamples.draw`, on the device of the meshes."""
        return host_samples.fresh_batch(self._cast, shapes, counts, random, part, self.codes.device)

    def _cast(
        self, shapes: Int[np.ndarray, "b"], counts: Mapping[str, int], seeds: Int[np.ndarray, "b"]
    ) -> dict[str, packing.Samples]:
        rows = np.zeros((len(shapes), _ROWS, sum(counts.values())), np.float32)
        for row, shape, seed in zip(rows, shapes, seeds, strict=True):
            random = np.random.default_rng(int(seed))
            _write(row, self.grounds[int(shape)].rounded(self.config, counts, dict.fromkeys(counts, random)))
        sent = arrays.send(rows, self.codes.device).movedim(1, 2)
        positions, directions, starts, own = sent[..., :12].unflatten(-1, (4, 3)).unbind(-2)
        depth, triangle = self.held.first_hits(shapes, starts, directions)
        visible, triangle = torch.isfinite(depth), triangle.clamp_min(0)
        depth = packing.round_depth((depth + sent[..., 12]).clamp_min(0))
        side = self.held.from_behind(triangle, directions).long()
        codes = self.codes[side, triangle].masked_fill(~visible[..., None], 0)
        normals = torch.where(own.any(-1, keepdim=True), own, packing.decode_unit(codes))
        whole = packing.Samples(
            positions=positions, directions=directions, depth=depth, visible=torch.isfinite(depth), normals=normals
        )
        ends = np.cumsum([0, *counts.values()])
        spans = zip(counts, ends[:-1], ends[1:], strict=True)
        return {kind: host_samples.rows_of(whole, slice(start, end)) for kind, start, end in spans}


_ROWS = 13  # position, direction, start, own normal (0: the hit's), how far the start is ahead


def _write(row: Float[np.ndarray, "rows n"], rays: sampling.Rounded) -> None:
    """What a device is told of rays."""
    row[0:3] = packing.decode_positions(torch.from_numpy(rays.positions.T)).numpy().T
    row[3:6], row[6:9] = rays.looking, rays.starts
    for kind, part in sampling.parts_of(rays.drawn).items():
        drew = rays.drawn[kind]
        if drew.normals is not None:
            stored = torch.from_numpy(packing.encode_unit(drew.normals, np.int8))
            row[9:12, part] = packing.decode_unit(stored).numpy().T
        if kind in rays.ahead:
            row[12, part] = rays.ahead[kind]


def held_meshes(grounds: GroundFile, device: torch.device) -> meshes.Meshes:
    """The triangles of all meshes, on a device."""
    number = range(len(grounds.counts))
    return meshes.joined(grounds.counts, (grounds[index].surface.corners for index in number), device)


def cast_samples(held: meshes.Meshes, grounds: GroundFile, config: sampling.SamplesConfig) -> CastSamples:
    """Samples of all meshes, cast where they are held."""
    codes = torch.zeros((2, held.corners.shape[1], 2), dtype=torch.int8, device=held.corners.device)
    for index, (begin, count) in enumerate(zip(held.begins[:-1], grounds.counts, strict=True)):
        own = sampling.side_codes(grounds[index].surface.normals)
        codes[:, begin : begin + count] = torch.from_numpy(own)
    return CastSamples(held, grounds, codes, config)

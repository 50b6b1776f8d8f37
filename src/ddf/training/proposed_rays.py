"""Rays that the field itself proposes in training, with the first hits that they really have (derived here).

Cloud drawing follows, from each point, the ray that the field holds to be the nearest visible surface. Of many rays it
takes the most inviting, so it finds every place where silhouettes are too fat: rays past an edge that are believed to
hit. Stored samples, drawn without regard to the field, rarely show it these. So a batch gets some of the rays that the
present field would choose, cast against the training mesh: values alone, no derivative is read.
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.core import arrays, checks, storage
from ddf.data.batches import category_data
from ddf.data.samples import sample_batch
from ddf.fields import losses, pddf, udf
from ddf.geometry import raycast
from ddf.models import reconstruction_settings

NEAR = 0.5  # share of the starts at true surface points + JITTER N(0, I), where later cycles of clouds start
JITTER = 0.2  # field units; the other starts are uniform in the cube
OPEN_PACKS = 8  # of training meshes, with their ray casting scenes; a shape of another one costs some 20 ms


@torch.no_grad()
def propose(
    field: pddf.PDDF,
    modulations: Sequence[Float[Tensor, "b 1 _"]],
    starts: Float[Tensor, "b n 3"],
    candidates: Float[Tensor, "b n k 3"],
) -> Float[Tensor, "b n 3"]:
    """v̂* of each start among its candidates, for the shape of each row. Costs b n k queries, values only.

    So many shapes at a time that a layer of their queries stays in the cache.
    """
    width = starts.shape[1] * candidates.shape[2] * max(field.config.hidden)
    rows = max(1, losses.block_values(starts.device) // width)
    held = [each.detach() for each in modulations]
    found = []
    for first in range(0, len(starts), rows):
        part = slice(first, first + rows)
        shape = candidates[part].shape
        queries = starts[part, :, None].expand(shape).flatten(1, 2), candidates[part].flatten(1, 2)
        raw = field(*queries, [each[part] for each in held])
        direction = udf.closest_directions(
            candidates[part].flatten(0, 1),
            pddf.visibility(raw).reshape(-1, shape[2]),
            field.depth(raw).reshape(-1, shape[2]),
            udf.TEMPERATURE,
            udf.INVERSE_DEPTH,
        )
        found.append(torch.nn.functional.normalize(direction, dim=-1).view_as(starts[part]))
    return torch.cat(found)


class Scenes:
    """The training mesh of each shape, in the field frame, ready for ray casting; a few packs are kept open."""

    def __init__(self, folder: Path, ids: Sequence[str]) -> None:
        """Scenes of the given shapes, in their order, from the packs of stage `meshes`."""
        self.paths = storage.shard_files(folder, ".meshes.safetensors", "meshes")
        places = {name: path for path in self.paths for name in storage.load_metadata(path)["ids"]}
        missing = [name for name in ids if name not in places]
        if missing:
            raise checks.InputError(f"{folder}: no prepared mesh of shape {missing[0]}; run the meshes stage again")
        self._places = [(places[name], name) for name in ids]
        self._open = functools.lru_cache(maxsize=OPEN_PACKS)(_scenes_of)

    def __getitem__(self, index: int, /) -> raycast.Scene:
        path, name = self._places[index]
        return self._open(path)(name)


def _scenes_of(pack: Path) -> Callable[[str], raycast.Scene]:
    """Of the meshes of one pack, each made a scene when it is first asked for."""
    from ddf.data import mesh_shards  # a step that casts no rays runs without its packages

    meshes = mesh_shards.read_pack(pack).meshes
    return functools.cache(lambda name: raycast.Scene(meshes[name]))


@dataclass(frozen=True)
class Proposer:
    """Puts proposed rays behind the stored samples of a batch. scenes: of the shapes, in their order."""

    shapes: category_data.ShapeSet
    scenes: "Scenes | Sequence[raycast.Scene]"
    config: reconstruction_settings.ProposalConfig

    @classmethod
    def read(
        cls, folder: Path, shapes: category_data.ShapeSet, config: reconstruction_settings.ProposalConfig | None
    ) -> tuple["Proposer | None", list[Path]]:
        """With the shapes' meshes, of the category's folder of the stage `meshes`, and their files; None and no files
        without a config.
        """
        if config is None:
            return None, []
        scenes = Scenes(folder, shapes.ids)
        return cls(shapes, scenes, config), scenes.paths

    def __call__(
        self,
        stored: sample_batch.SampleBatch,
        field: pddf.PDDF,
        modulations: Sequence[Float[Tensor, "b 1 _"]],
        chosen: Int[np.ndarray, "b"],
        random: np.random.Generator,
    ) -> sample_batch.SampleBatch:
        """`stored`, of the shapes `chosen`, with rays of type P behind; all on the device of `stored`."""
        place = stored.positions.device
        starts = self._starts(chosen, random)
        size = (*starts.shape[:2], self.config.directions, 3)
        candidates = torch.from_numpy(random.standard_normal(size, dtype=np.float32))
        starts, candidates = arrays.send(starts, place), arrays.send(candidates, place)
        candidates = torch.nn.functional.normalize(candidates, dim=-1)
        directions = propose(field, modulations, starts, candidates)
        depth, triangle = self._first_hits(chosen, starts, directions)
        visible = triangle >= 0
        depth = depth.masked_fill(~visible, 0.0)
        normals = torch.zeros_like(starts)  # never read
        counts = {"P": self.config.points}
        return stored.followed_by(sample_batch.SampleBatch(starts, directions, visible.float(), depth, normals, counts))

    def _first_hits(
        self, shapes: Int[np.ndarray, "b"], positions: Float[Tensor, "b n 3"], directions: Float[Tensor, "b n 3"]
    ) -> tuple[Float[Tensor, "b n"], Int[Tensor, "b n"]]:
        """Depth, float32, and triangle of a row of rays against each shape's mesh; `inf` and -1 on a miss."""
        hits = [
            self.scenes[int(shape)].first_hits(starts.double().numpy(), own.double().numpy())
            for shape, starts, own in zip(shapes, positions.cpu(), directions.cpu(), strict=True)
        ]
        depth, triangle = (torch.from_numpy(np.stack(parts)) for parts in zip(*hits, strict=True))
        return depth.float().to(positions.device), triangle.to(positions.device)

    def _starts(self, chosen: Int[np.ndarray, "b"], random: np.random.Generator) -> Float[Tensor, "b n 3"]:
        near = round(NEAR * self.config.points)
        uniform = random.uniform(-1, 1, (len(chosen), self.config.points - near, 3)).astype(np.float32)
        noise = random.standard_normal((len(chosen), near, 3), dtype=np.float32)
        surface = self.shapes.subsets(chosen, near, random)
        starts = torch.cat((torch.from_numpy(uniform), surface + JITTER * torch.from_numpy(noise)), dim=1)
        return starts.clamp(-1, 1)

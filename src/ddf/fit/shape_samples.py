"""The samples of one shape, decoded and in memory: what a fit draws its batches from, and is measured on.

Of a mesh, or of measured rays where no surface is given. A ray that ended on something tells its depth from every place
on it, less by as much as the place is ahead; one that went on, that nothing is met from any of its places. No ray tells
normals, nor what is seen along a surface or from behind it: these terms of the loss and types of samples are left out.
Source: [DDF22] §1, pointwise depth data, and §3.1, property I: ∂d(p + s v, v)/∂s = -1.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.data import packing
from ddf.data.samples import extraction, sample_types
from ddf.geometry import mesh_io, rays, scans, transforms

if TYPE_CHECKING:
    from ddf.data.samples import sample_batch
    from ddf.fields import losses

RAY_KIND = "A"  # as which the loss takes samples of rays: with depth, visibility and both eikonal terms
HELD_OUT = 10_000  # of each type, for the errors
THIN_BOX = 0.05  # of its longest side: a thinner mesh is fitted in the cube, for its own box has no room for rays


@dataclass(frozen=True)
class ShapeSamples:
    """Decoded samples of one shape by type, float32, and its box, field frame; depth is 0 on a miss.

    A type may be absent: the field is then fitted without it. unit: half of the shape's longest side, field units.
    """

    arrays: Mapping[str, Mapping[str, np.ndarray]]
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    unit: float = 1.0

    def without(self, kind: str) -> "ShapeSamples":
        """The same without one type."""
        return dataclasses.replace(self, arrays={name: part for name, part in self.arrays.items() if name != kind})

    def batch_counts(self, counts: Mapping[str, int]) -> dict[str, int]:
        """The counts per step with the share of absent types given to the others, in their proportions.

        So a step sees as many supervised points whichever type is left out ([DDF22] app. `dataablation` keeps the
        number of samples; what a minibatch holds it does not say).
        """
        supervised = {kind: count for kind, count in counts.items() if kind != "E"}
        kept = {kind: count for kind, count in supervised.items() if sample_types.base(kind) in self.arrays}
        share = sum(supervised.values()) / sum(kept.values())
        return {"E": counts["E"], **{kind: round(count * share) for kind, count in kept.items()}}

    def batch(self, counts: Mapping[str, int], random: np.random.Generator) -> "sample_batch.SampleBatch":
        """Random samples of each type in `counts`, with repetition, and `counts["E"]` uniform points of the box."""
        import torch

        from ddf.data.samples import sample_batch

        extra = counts["E"]
        position = random.uniform(self.lower, self.upper, (extra, 3)).astype(np.float32)
        direction = random.standard_normal((extra, 3)).astype(np.float32)
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        chosen = [
            {
                "positions": position,
                "directions": direction,
                "visible": np.zeros(extra, np.float32),
                "depth": np.zeros(extra, np.float32),
                "normals": np.zeros((extra, 3), np.float32),
            }
        ]
        for kind in [name for name in sample_types.STORED if name in counts]:
            stored = self.arrays[sample_types.base(kind)]
            rows = random.integers(0, len(stored["depth"]), counts[kind])
            chosen.append({name: values[rows] for name, values in stored.items()})
        joined = {name: torch.from_numpy(np.concatenate([part[name] for part in chosen]))[None] for name in chosen[0]}
        return sample_batch.SampleBatch(**joined, counts=counts)


@dataclass(frozen=True)
class Drawing:
    """How samples of one shape are drawn: margin and offset of O samples as of `fit_settings.FitConfig`, and a seed."""

    margin: float = 0.02
    epsilon_o: float = 0.05
    seed: int = 0


def draw_samples(
    mesh: mesh_io.Mesh,
    drawing: Drawing,
    counts: dict[str, int],
    stream: str,
    describe: str | None = None,
) -> ShapeSamples:
    """Samples of a mesh, field frame.

    Args:
      mesh: in [-1, 1]^3; it is shrunk to leave the margin.
      stream: name of the random stream; training and held-out samples have their own.
      describe: title of a progress bar; None for none.
    """
    mesh, drawn = within(mesh, drawing, counts)
    packed = extraction.extract(mesh, drawn, stream, describe=describe)
    arrays = {}
    for kind in sample_types.KINDS:
        samples = packing.decode(packed, kind)
        visible = samples["visible"]
        arrays[kind] = {
            "positions": samples["positions"],
            "directions": samples["directions"],
            "visible": visible.astype(np.float32),
            "depth": np.where(visible, samples["depth"], np.float32(0)),
            "normals": samples["normals"],
        }
    sides = extraction.box_of(mesh, drawn)
    unit = 1 - drawing.margin
    return ShapeSamples(arrays, sides.lower.astype(np.float64), sides.upper.astype(np.float64), unit)


def within(
    mesh: mesh_io.Mesh, drawing: Drawing, counts: dict[str, int]
) -> tuple[mesh_io.Mesh, extraction.SamplesConfig]:
    """A mesh in [-1, 1]^3, shrunk to leave the margin, and how its samples are drawn."""
    unit = 1 - drawing.margin
    mesh = mesh_io.Mesh(unit * mesh.vertices, mesh.faces)
    lower, upper = mesh.box()
    box = "cube" if (upper - lower).min() < THIN_BOX * (upper - lower).max() else "tight"
    offset = drawing.epsilon_o * unit
    return mesh, extraction.SamplesConfig(counts, offset, "fixed", box, drawing.margin, seed=drawing.seed)


def ray_weights(of_mesh: "losses.LossWeights") -> "losses.LossWeights":
    """Those of a fit to a mesh, but for what rays do not tell."""
    return dataclasses.replace(of_mesh, normals=0.0, transition=0.0)


def draw_from_rays(
    scan: scans.Scan,
    surface: mesh_io.Mesh,
    field_from_scan: transforms.Similarity,
    config: extraction.SamplesConfig,
    count: int,
) -> ShapeSamples:
    """So many samples, float32, of the rays that cross the shape's box, field frame.

    Args:
      surface: that the hits have in common, field frame: the box is its own.
      config: of samples of a mesh: margin, box and seed.
    Raises:
      InputError: no ray crosses the box.
    """
    box, scale = extraction.box_of(surface, config), field_from_scan.scale
    starts, ways = field_from_scan.apply(scan.positions), field_from_scan.apply_directions(scan.directions)
    first, last = rays.box_span(starts, ways, box.lower, box.upper)
    ended = scale * scan.ranges < last
    end = np.minimum(scale * scan.ranges, last)
    (useful,) = np.nonzero(first < end)
    if not len(useful):
        raise checks.InputError("no ray crosses the box of what the rays hit")
    random = np.random.default_rng(config.seed)
    rows = useful[random.integers(0, len(useful), count)]
    along = first[rows] + random.random(count) * (end - first)[rows]
    visible = ended[rows].astype(np.float32)
    samples = {
        "positions": rays.surface_points(starts[rows], ways[rows], along).astype(np.float32),
        "directions": ways[rows].astype(np.float32),
        "visible": visible,
        "depth": (visible * (end[rows] - along)).astype(np.float32),
        "normals": np.zeros((count, 3), np.float32),
    }
    lower, upper = (side.astype(np.float64) for side in (box.lower, box.upper))
    return ShapeSamples({RAY_KIND: samples}, lower, upper, 1 - config.margin)

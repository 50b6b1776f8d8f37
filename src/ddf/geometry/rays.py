"""Oriented points, what a ray meets, and where it enters a box.

Letters: p position, v unit direction, t distance along v, B axis-aligned box [lower, upper].
Every function takes numpy-free torch tensors of any float type and keeps that type.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from ddf.core import checks


@dataclass(frozen=True)
class OrientedPoints:
    """Positions p and unit directions v in one frame, stated by whoever makes them.

    Raises:
      InputError: shapes differ, a value is not finite, or a direction is not of unit length.
    """

    positions: Float[Tensor, "*batch 3"]
    directions: Float[Tensor, "*batch 3"]

    def __post_init__(self) -> None:
        checks.require_vectors("positions", self.positions)
        if self.positions.shape != self.directions.shape:
            shapes = f"{tuple(self.positions.shape)} and {tuple(self.directions.shape)}"
            raise checks.InputError(f"positions and directions must have one shape; got {shapes}")
        checks.require_finite("positions", self.positions)
        checks.require_unit("directions", self.directions)


@dataclass(frozen=True)
class RayHits:
    """What each ray p + t v, t >= 0, meets first.

    depth: t, in the unit of the positions; `inf` on a miss.
    visible: true where there is a hit.
    normals: unit normals at the hit, facing back (n·v <= 0); zero on a miss.
    face: index of the triangle hit; -1 on a miss, or where the surface has no triangles.
    """

    depth: Float[Tensor, "*batch"]
    visible: Bool[Tensor, "*batch"]
    normals: Float[Tensor, "*batch 3"]
    face: Int[Tensor, "*batch"]


def surface_points(
    positions: Float[Tensor, "*batch 3"], directions: Float[Tensor, "*batch 3"], depth: Float[Tensor, "*batch"]
) -> Float[Tensor, "*batch 3"]:
    """q = p + d v. Source: [DDF22] §3. Not finite on misses: index the visible rays first."""
    return positions + depth[..., None] * directions


def box_span(
    positions: Float[Tensor, "*batch 3"],
    directions: Float[Tensor, "*batch 3"],
    lower: Float[Tensor, "3"],
    upper: Float[Tensor, "3"],
) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch"]]:
    """First and last t >= 0 for which p + t v lies in the closed box (slab test; derived here).

    Exact where a component of v is zero: that slab then holds for all t or for none, and no 0/0 is formed.
    A ray misses the box where `entry > exit`. Inside the box the entry is 0.
    Differentiable in p and v wherever the ray is not exactly parallel to the slab that it enters by.
    """
    parallel = directions == 0
    inverse = 1.0 / torch.where(parallel, torch.ones_like(directions), directions)
    to_lower, to_upper = (lower - positions) * inverse, (upper - positions) * inverse
    near, far = torch.minimum(to_lower, to_upper), torch.maximum(to_lower, to_upper)
    between = (positions >= lower) & (positions <= upper)
    infinity = torch.full_like(near, torch.inf)
    near = torch.where(parallel, torch.where(between, -infinity, infinity), near)
    far = torch.where(parallel, torch.where(between, infinity, -infinity), far)
    return near.amax(-1).clamp_min(0.0), far.amin(-1)


def enter_box(
    positions: Float[Tensor, "*batch 3"],
    directions: Float[Tensor, "*batch 3"],
    lower: Float[Tensor, "3"],
    upper: Float[Tensor, "3"],
) -> tuple[Float[Tensor, "*batch 3"], Float[Tensor, "*batch"], Bool[Tensor, "*batch"]]:
    """Move every ray's start to where it enters the box. Source: [DDF22] §3.2 (rendering from outside B).

    Returns:
      Entry points (clamped onto the box, so that far cameras leave no rounding outside it; the start itself
      where the ray misses), the distance travelled (0 inside, and 0 on a miss) and whether the ray meets the box.
    """
    entry, leave = box_span(positions, directions, lower, upper)
    meets = entry <= leave
    distance = torch.where(meets, entry, torch.zeros_like(entry))
    inside = torch.minimum(torch.maximum(positions + distance[..., None] * directions, lower), upper)
    return torch.where(meets[..., None], inside, positions), distance, meets

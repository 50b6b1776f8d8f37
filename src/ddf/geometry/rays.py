"""Oriented points, what a ray meets, and where it enters a box.

Letters: p position, v unit direction, t distance along v, B axis-aligned box [lower, upper].
Every function takes numpy arrays or torch tensors of any float type, and keeps library and type.
"""

from dataclasses import dataclass
from typing import Generic

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf.core import arrays, checks
from ddf.core.arrays import Array


@dataclass(frozen=True)
class OrientedPoints(Generic[Array]):
    """Positions p and unit directions v in one frame, stated by whoever makes them.

    Raises:
      InputError: shapes differ, a value is not finite, or a direction is not of unit length.
    """

    positions: Float[Array, "*batch 3"]
    directions: Float[Array, "*batch 3"]

    def __post_init__(self) -> None:
        checks.require_vectors("positions", self.positions)
        if self.positions.shape != self.directions.shape:
            shapes = f"{tuple(self.positions.shape)} and {tuple(self.directions.shape)}"
            raise checks.InputError(f"positions and directions must have one shape; got {shapes}")
        checks.require_finite("positions", self.positions)
        checks.require_unit("directions", self.directions)


def unit_points(positions: np.ndarray, directions: np.ndarray) -> OrientedPoints[np.ndarray]:
    """As `OrientedPoints`, with directions divided by their lengths: 1e-4 in a length is .1 in a depth of 1000."""
    checked = OrientedPoints(positions, directions)
    return OrientedPoints(checked.positions, directions / np.linalg.norm(directions, axis=-1, keepdims=True))


@dataclass(frozen=True)
class RayHits(Generic[Array]):
    """What each ray p + t v, t >= 0, meets first.

    depth: t, in the unit of the positions; `inf` on a miss.
    visible: true where there is a hit.
    normals: unit normals at the hit, facing back (n·v <= 0); zero on a miss.
    face: index of the triangle hit; -1 on a miss, or where the surface has no triangles.
    """

    depth: Float[Array, "*batch"]
    visible: Bool[Array, "*batch"]
    normals: Float[Array, "*batch 3"]
    face: Int[Array, "*batch"]


def surface_points(
    positions: Float[Array, "*batch 3"], directions: Float[Array, "*batch 3"], depth: Float[Array, "*batch"]
) -> Float[Array, "*batch 3"]:
    """q = p + d v. Source: [DDF22] §3. Not finite on misses: index the visible rays first."""
    return positions + depth[..., None] * directions


def box_span(
    positions: Float[Array, "*batch 3"],
    directions: Float[Array, "*batch 3"],
    lower: Float[Array, "3"],
    upper: Float[Array, "3"],
) -> tuple[Float[Array, "*batch"], Float[Array, "*batch"]]:
    """First and last t >= 0 for which p + t v lies in the closed box (slab test; derived here).

    Exact where a component of v is zero: that slab then holds for all t or for none, and no 0/0 is formed.
    A ray misses the box where `entry > exit`. Inside the box the entry is 0.
    Differentiable in p and v wherever the ray is not exactly parallel to the slab that it enters by.
    """
    xp = arrays.namespace(positions)
    parallel = directions == 0
    inverse = 1.0 / xp.where(parallel, xp.ones_like(directions), directions)
    to_lower, to_upper = (lower - positions) * inverse, (upper - positions) * inverse
    near, far = xp.minimum(to_lower, to_upper), xp.maximum(to_lower, to_upper)
    between = (positions >= lower) & (positions <= upper)
    infinity = xp.full_like(near, xp.inf)
    near = xp.where(parallel, xp.where(between, -infinity, infinity), near)
    far = xp.where(parallel, xp.where(between, infinity, -infinity), far)
    return xp.clip(xp.amax(near, -1), 0.0, None), xp.amin(far, -1)


def enter_box(
    positions: Float[Array, "*batch 3"],
    directions: Float[Array, "*batch 3"],
    lower: Float[Array, "3"],
    upper: Float[Array, "3"],
) -> tuple[Float[Array, "*batch 3"], Float[Array, "*batch"], Bool[Array, "*batch"]]:
    """Move every ray's start to where it enters the box. Source: [DDF22] §3.2 (rendering from outside B).

    Returns:
      Entry points (clamped onto the box, so that far cameras leave no rounding outside it; the start itself
      where the ray misses), the distance travelled (0 inside, and 0 on a miss) and whether the ray meets the box.
    """
    xp = arrays.namespace(positions)
    entry, leave = box_span(positions, directions, lower, upper)
    meets = entry <= leave
    distance = xp.where(meets, entry, xp.zeros_like(entry))
    inside = xp.minimum(xp.maximum(positions + distance[..., None] * directions, lower), upper)
    return xp.where(meets[..., None], inside, positions), distance, meets

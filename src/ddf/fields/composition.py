"""Several fields in one scene: visibility and depth of what a ray meets among them. [DDF22] §4.1, composition.

With ξ_k, d_k what field k says of the oriented point in its own frame, depths in world units,

  ξ = 1 - Π_k (1 - ξ_k),   a = softmax_k( ξ_k / (η_T (ε_s + d_k)) ),   d = Σ_k a_k d_k.

A field is defined in its box B_k: from outside, a ray enters B_k first and the way there is part of d_k ([DDF22] §3.2),
and a field whose box the ray misses takes no part, neither in the product nor in the softmax (the paper is silent).
Nor does an exact field that answers with depth `inf`. Beside the soft depth stands the hard choice, the nearest depth
among the fields that are visible: exact where the fields are, but not differentiable from one field to the next.
Numpy arrays and torch tensors alike; for tensors everything else is differentiable.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf.core import arrays, checks
from ddf.core.arrays import Array
from ddf.geometry import rays, transforms

SMALLEST = float(np.finfo(np.float64).tiny)  # its inverse is still finite
SEEN = 0.5  # visibility from which on a field counts in the hard choice
# positions and unit directions (n, 3) of a field's own frame -> visibility (n) in [0, 1] and depth (n)
Query = Callable[[Any, Any], tuple[Any, Any]]


@dataclass(frozen=True)
class Placed:
    """One field in the scene.

    query: the field, asked in its own frame and inside its box only.
    field_from_world: T_k, maps the scene to the field's frame; its scale is field units per world unit.
    lower, upper: corners of B_k, the field's frame; for closed forms a little outside their surface, or rounding may
    put a start beyond it.
    """

    query: Query
    field_from_world: transforms.Similarity
    lower: tuple[float, float, float] = (-1.0, -1.0, -1.0)
    upper: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise checks.InputError(f"lower must be below upper on every axis; got {self.lower} and {self.upper}")


@dataclass(frozen=True)
class Composite(Generic[Array]):
    """What each ray meets in the scene; depths in world units.

    visibility: ξ, 0 where every box is missed. nearest_visibility: the largest ξ_k, of the hard choice: at least 1/2
    exactly where that has a depth, as ξ need not be. depth: d, `inf` where every field is. nearest_depth: the least
    depth of the fields with visibility >= 1/2, `inf` where there is none. nearest: which field that is, -1 where there
    is none. weights: a_k, field by field; 0 for one that takes no part. queries: oriented points that fields were asked
    for, all fields together.
    """

    visibility: Float[Array, "n"]
    nearest_visibility: Float[Array, "n"]
    depth: Float[Array, "n"]
    nearest_depth: Float[Array, "n"]
    nearest: Int[Array, "n"]
    weights: Float[Array, "k n"]
    queries: int


def compose(
    objects: Sequence[Placed],
    positions: Float[Array, "n 3"],
    directions: Float[Array, "n 3"],
    temperature: float,
    inverse_depth: float,
) -> Composite[Array]:
    """Visibility and depth of a scene; differentiable in p, v and the fields' parameters where those are.

    A field is asked for the rays that meet its box and for no others.

    Args:
      positions, directions: world frame, directions unit; float64 where cameras are far.
      temperature: η_T. inverse_depth: ε_s, world units. The paper gives neither. Surfaces at depths d < e mix unless
        η_T is well below 1/(ε_s + d) - 1/(ε_s + e): far scenes need a small one.
    Raises:
      InputError: no object, or a constant that is not positive and finite.
    """
    if not objects:
        raise checks.InputError("a scene needs at least one object; got none")
    for name, value in (("temperature", temperature), ("inverse_depth", inverse_depth)):
        if not SMALLEST <= value < float("inf"):
            raise checks.InputError(f"{name} must be positive and finite; got {value}")
    answers = [_ask(placed, positions, directions) for placed in objects]
    xp = arrays.namespace(positions)
    visibilities, depths = (xp.stack(values) for values in zip(*(answer[:2] for answer in answers), strict=True))
    weights, near = soft_weights(visibilities, depths, temperature, inverse_depth)
    nothing = ~near.any(0)
    depth = (weights * xp.where(near, depths, 0.0)).sum(0)
    hard = xp.where(visibilities >= SEEN, depths, xp.inf)
    nearest_depth = xp.amin(hard, 0)
    return Composite(
        visibility=1 - (1 - visibilities).prod(0),
        nearest_visibility=xp.amax(visibilities, 0),
        depth=xp.where(nothing, xp.inf, depth),
        nearest_depth=nearest_depth,
        nearest=xp.where(xp.isfinite(nearest_depth), xp.argmin(hard, 0), -1),
        weights=weights,
        queries=sum(answer[2] for answer in answers),
    )


def soft_weights(
    visibilities: Float[Array, "k n"], depths: Float[Array, "k n"], temperature: float, inverse_depth: float
) -> tuple[Float[Array, "k n"], Bool[Array, "k n"]]:
    """a_k, and which fields take part; a_k sums to 1 over these, and to 0 where there are none.

    In float64, and the largest ξ_k / (ε_s + d_k) is taken off before the division by η_T: no η_T or ε_s overflows.
    """
    xp = arrays.namespace(depths)
    near = xp.isfinite(depths)
    finite = arrays.double(xp.where(near, depths, 0.0))
    score = xp.where(near, arrays.double(visibilities) / (inverse_depth + finite), -xp.inf)
    some = near.any(0)
    best = xp.where(some, xp.amax(score, 0), 0.0)
    power = xp.exp((score - arrays.detached(best)) / temperature)
    weights = power / xp.where(some, power.sum(0), 1.0)
    return arrays.like(weights, depths), near


def _ask(
    placed: Placed, positions: Float[Array, "n 3"], directions: Float[Array, "n 3"]
) -> tuple[Float[Array, "n"], Float[Array, "n"], int]:
    """ξ_k (0 where the box is missed), d_k in world units (`inf` there) and the number of queries."""
    xp, transform = arrays.namespace(positions), placed.field_from_world
    rotation, translation = (arrays.like(values, positions) for values in (transform.rotation, transform.translation))
    lower, upper = (arrays.like(np.array(corner), positions) for corner in (placed.lower, placed.upper))
    looking = directions @ rotation.T
    entry, distance, meets = rays.enter_box(
        transform.scale * (positions @ rotation.T) + translation, looking, lower, upper
    )
    found, depth = placed.query(entry[meets], looking[meets])
    seen, far = xp.zeros_like(distance), xp.full_like(distance, xp.inf)
    seen[meets] = arrays.like(found, positions)
    far[meets] = (arrays.like(depth, positions) + distance[meets]) / transform.scale
    return seen, far, int(meets.sum())

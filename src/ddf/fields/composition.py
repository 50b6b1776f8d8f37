"""Several fields in one scene: visibility and depth of what a ray meets among them. [DDF22] §4.1, composition.

With ξ_k, d_k what field k says of the oriented point in its own frame, depths in world units,

  ξ = 1 - Π_k (1 - ξ_k),   a = softmax_k( ξ_k / (η_T (ε_s + d_k)) ),   d = Σ_k a_k d_k.

A field is defined in its box B_k: from outside, a ray enters B_k first and the way there is part of d_k ([DDF22] §3.2),
and a field whose box the ray misses takes no part, neither in the product nor in the softmax (the paper is silent).
Nor does an exact field that answers with depth `inf`. Beside the soft depth stands the hard choice, the nearest depth
among the fields that are visible: exact where the fields are, but not differentiable from one field to the next.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.core import checks
from ddf.fields.pddf import PDDF, visibility
from ddf.geometry import primitives, rays, transforms

SMALLEST = torch.finfo(torch.float64).tiny  # its inverse is still finite
SEEN = 0.5  # visibility from which on a field counts in the hard choice
# positions and unit directions (n, 3) of a field's own frame -> visibility (n) in [0, 1] and depth (n)
Query = Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]


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
class Composite:
    """What each ray meets in the scene; depths in world units.

    visibility: ξ, 0 where every box is missed. depth: d, `inf` where every field is. nearest_depth: the least depth of
    the fields with visibility >= 1/2, `inf` where there is none.
    queries: oriented points that fields were asked for, all fields together.
    """

    visibility: Float[Tensor, "n"]
    depth: Float[Tensor, "n"]
    nearest_depth: Float[Tensor, "n"]
    queries: int


def field_query(field: PDDF, modulations: Sequence[Tensor] | None = None) -> Query:
    """A network as a field of the scene, evaluated in its own type."""

    def query(
        positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n"]]:
        weight = field.network.head.weight
        raw = field(positions.to(weight), directions.to(weight), modulations)
        return visibility(raw), field.depth(raw)

    return query


def primitive_query(shape: primitives.Primitive) -> Query:
    """A closed form as a field of the scene: visibility 0 or 1, depth `inf` on a miss."""

    def query(
        positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n"]]:
        depth, _ = shape.first(positions, directions)
        return torch.isfinite(depth).to(depth), depth

    return query


def compose(
    objects: Sequence[Placed],
    positions: Float[Tensor, "n 3"],
    directions: Float[Tensor, "n 3"],
    temperature: float,
    inverse_depth: float,
    cull: bool = True,
) -> Composite:
    """Visibility and depth of a scene; differentiable in p, v and the fields' parameters where those are.

    Args:
      positions, directions: world frame, directions unit; float64 where cameras are far.
      temperature: η_T. inverse_depth: ε_s, world units. The paper gives neither. Surfaces at depths d < e mix unless
        η_T is well below 1/(ε_s + d) - 1/(ε_s + e): far scenes need a small one.
      cull: a field is asked for the rays that meet its box and for no others. Without, it is asked for all of them and
        the answers for rays that miss the box are dropped: same result, more queries.
    Raises:
      InputError: no object, or a constant that is not positive and finite.
    """
    if not objects:
        raise checks.InputError("a scene needs at least one object; got none")
    for name, value in (("temperature", temperature), ("inverse_depth", inverse_depth)):
        if not SMALLEST <= value < float("inf"):
            raise checks.InputError(f"{name} must be positive and finite; got {value}")
    answers = [_ask(placed, positions, directions, cull) for placed in objects]
    visibilities, depths = (torch.stack(values) for values in zip(*(answer[:2] for answer in answers), strict=True))
    weights, near = soft_weights(visibilities, depths, temperature, inverse_depth)
    nothing = ~near.any(dim=0)
    depth = (weights * torch.where(near, depths, 0.0)).sum(dim=0)
    return Composite(
        visibility=1 - (1 - visibilities).prod(dim=0),
        depth=torch.where(nothing, torch.inf, depth),
        nearest_depth=torch.where(visibilities >= SEEN, depths, torch.inf).amin(dim=0),
        queries=sum(answer[2] for answer in answers),
    )


def soft_weights(
    visibilities: Float[Tensor, "k n"], depths: Float[Tensor, "k n"], temperature: float, inverse_depth: float
) -> tuple[Float[Tensor, "k n"], Bool[Tensor, "k n"]]:
    """a_k, and which fields take part; a_k sums to 1 over these, and to 0 where there are none.

    In float64, and the largest ξ_k / (ε_s + d_k) is taken off before the division by η_T: no η_T or ε_s overflows.
    """
    near = torch.isfinite(depths)
    finite = torch.where(near, depths, 0.0).double()
    score = torch.where(near, visibilities.double() / (inverse_depth + finite), -torch.inf)
    some = near.any(dim=0)
    best = torch.where(some, score.amax(dim=0), 0.0)
    power = torch.exp((score - best.detach()) / temperature)
    weights = power / torch.where(some, power.sum(dim=0), 1.0)
    return weights.to(depths), near


def _ask(
    placed: Placed, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"], cull: bool
) -> tuple[Float[Tensor, "n"], Float[Tensor, "n"], int]:
    """ξ_k (0 where the box is missed), d_k in world units (`inf` there) and the number of queries."""
    transform = placed.field_from_world
    rotation, translation = (
        torch.from_numpy(values).to(positions) for values in (transform.rotation, transform.translation)
    )
    lower, upper = (positions.new_tensor(corner) for corner in (placed.lower, placed.upper))
    looking = directions @ rotation.T
    entry, distance, meets = rays.enter_box(
        transform.scale * (positions @ rotation.T) + translation, looking, lower, upper
    )
    asked = meets if cull else torch.ones_like(meets)
    found, depth = placed.query(entry[asked], looking[asked])
    depth = (depth.to(positions) + distance[asked]) / transform.scale
    seen = torch.zeros_like(distance).masked_scatter(asked, found.to(positions))
    far = torch.full_like(distance, torch.inf).masked_scatter(asked, depth)
    return torch.where(meets, seen, 0.0), torch.where(meets, far, torch.inf), int(asked.sum())

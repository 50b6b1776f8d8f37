"""Closed-form directed distance fields: the truth of figures and tests. Torch, float64, differentiable in p and v.

Each shape is a surface, not a solid: hits from inside count, and normals face back (n·v <= 0). Curvatures are those of
[DDF22] Property V, with respect to the normal that faces the viewer: II(t, t) = κ is the height that the surface gains
towards the viewer, per half tangent length squared. So a sphere of radius r has κ = -1/r seen from outside and +1/r
from inside; the mean curvature is κ1 + κ2 (no 1/2, as printed in the paper) and the Gaussian curvature κ1 κ2. Misses
have depth `inf`, zero normals and zero curvatures.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.geometry import rays


@runtime_checkable
class Primitive(Protocol):
    """A surface that every ray can be met with in closed form."""

    def first(
        self, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n 3"]]:
        """First t >= 0 on the surface (`inf` on a miss) and the outward unit normal there (any value on a miss)."""
        ...

    def outward_curvatures(self, points: Float[Tensor, "n 3"], outward: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
        """Principal curvatures at surface points with respect to the outward normal (convex is negative)."""
        ...


def cast(shape: Primitive, points: rays.OrientedPoints) -> rays.RayHits:
    """What each oriented point sees first; `face` is -1 throughout."""
    depth, normals, _ = _meet(shape, points)
    visible = torch.isfinite(depth)
    return rays.RayHits(depth, visible, normals, torch.full(depth.shape, -1, dtype=torch.int64))


def curvatures(shape: Primitive, points: rays.OrientedPoints) -> Float[Tensor, "*batch 2"]:
    """Principal curvatures where each ray hits, with respect to the normal that faces the viewer."""
    return _meet(shape, points)[2]


def _meet(
    shape: Primitive, points: rays.OrientedPoints
) -> tuple[Float[Tensor, "*batch"], Float[Tensor, "*batch 3"], Float[Tensor, "*batch 2"]]:
    batch = points.positions.shape[:-1]
    positions, directions = points.positions.reshape(-1, 3), points.directions.reshape(-1, 3)
    depth, outward = shape.first(positions, directions)
    hit = torch.isfinite(depth)
    side = torch.where((outward * directions).sum(-1) > 0, -1.0, 1.0).to(depth.dtype)
    normals = torch.where(hit[:, None], side[:, None] * outward, torch.zeros_like(outward))
    q = positions + torch.where(hit, depth, torch.zeros_like(depth))[:, None] * directions
    kappa = side[:, None] * shape.outward_curvatures(q, outward)
    kappa = torch.where(hit[:, None], kappa, torch.zeros_like(kappa))
    return depth.reshape(batch), normals.reshape(*batch, 3), kappa.reshape(*batch, 2)


@dataclass(frozen=True)
class Sphere:
    """|x - centre| = radius."""

    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 1.0

    def first(
        self, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n 3"]]:
        """Roots of t² + 2 b t + c = 0 from the point of the line nearest the centre, which keeps far cameras exact."""
        centre = positions.new_tensor(self.centre)
        start = positions - centre
        b = (start * directions).sum(-1)
        foot = start - b[:, None] * directions
        quarter = self.radius**2 - (foot**2).sum(-1)
        meets = quarter >= 0
        half = torch.sqrt(torch.where(meets, quarter, torch.ones_like(quarter)))
        near, far = -b - half, -b + half
        t = torch.where(near >= 0, near, far)
        depth = _inf_unless(t, meets & (far >= 0))
        q = start + torch.where(torch.isfinite(depth), t, torch.zeros_like(t))[:, None] * directions
        return depth, q / self.radius

    def outward_curvatures(self, points: Float[Tensor, "n 3"], outward: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
        """-1/r twice."""
        return points.new_full((len(points), 2), -1.0 / self.radius)


@dataclass(frozen=True)
class Box:
    """The surface of the axis-aligned box [lower, upper]."""

    lower: tuple[float, float, float] = (-1.0, -1.0, -1.0)
    upper: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def first(
        self, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n 3"]]:
        """Entry of the slab test from outside, exit from inside."""
        lower, upper = positions.new_tensor(self.lower), positions.new_tensor(self.upper)
        still = directions == 0
        inverse = 1 / torch.where(still, torch.ones_like(directions), directions)
        a, b = (lower - positions) * inverse, (upper - positions) * inverse
        between = (positions >= lower) & (positions <= upper)
        infinity = torch.full_like(a, torch.inf)
        near = torch.where(still, torch.where(between, -infinity, infinity), torch.minimum(a, b))
        far = torch.where(still, torch.where(between, infinity, -infinity), torch.maximum(a, b))
        entry, entry_axis = near.max(dim=-1)
        leave, leave_axis = far.min(dim=-1)
        outside = entry >= 0
        depth = _inf_unless(torch.where(outside, entry, leave), (entry <= leave) & (leave >= 0))
        axis = torch.where(outside, entry_axis, leave_axis)
        sign = torch.where(outside, -1.0, 1.0).to(directions.dtype)
        onto = torch.nn.functional.one_hot(axis, 3).to(directions.dtype)
        return depth, onto * (sign[:, None] * torch.sign(directions))

    def outward_curvatures(self, points: Float[Tensor, "n 3"], outward: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
        """Zero on the faces; edges carry no value."""
        return points.new_zeros(len(points), 2)


@dataclass(frozen=True)
class Union:
    """Several surfaces; a ray sees the nearest (inner ones too: nested spheres are two sheets)."""

    parts: Sequence[Primitive] = field(default_factory=tuple)

    def first(
        self, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n 3"]]:
        """Least depth over the parts, with that part's normal."""
        depths, normals = zip(*(part.first(positions, directions) for part in self.parts), strict=True)
        depth, index = torch.stack(depths).min(dim=0)
        return depth, torch.stack(normals)[index, torch.arange(len(index))]

    def outward_curvatures(self, points: Float[Tensor, "n 3"], outward: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
        """Those of the part that the point lies on: the one that a short ray against the normal meets first."""
        starts = points + 1e-3 * outward
        depths = torch.stack([part.first(starts, -outward)[0] for part in self.parts])
        index = (depths - 1e-3).abs().argmin(dim=0)
        values = torch.stack([part.outward_curvatures(points, outward) for part in self.parts])
        return values[index, torch.arange(len(index))]


def two_spheres() -> Union:
    """Two equal spheres side by side along x."""
    return Union((Sphere((-0.55, 0.0, 0.0), 0.4), Sphere((0.55, 0.0, 0.0), 0.4)))


def _inf_unless(values: Float[Tensor, "n"], keep: Bool[Tensor, "n"]) -> Float[Tensor, "n"]:
    return torch.where(keep, values, torch.full_like(values, torch.inf))

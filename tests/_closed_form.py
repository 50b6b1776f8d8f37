"""Closed forms for tests alone, beside those of `primitives`; and a closed form asked as a fitted field is."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.geometry import primitives, rays, transforms

_REAL_ROOT = 1e-5  # imaginary part that counts as none: a double root of a quartic is known to sqrt(eps) ~ 1e-8


@dataclass(frozen=True)
class Plane:
    """normal · x = offset; `normal` is its outward side and of unit length."""

    normal: tuple[float, float, float] = (0.0, 1.0, 0.0)
    offset: float = 0.0

    def first(
        self, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n 3"]]:
        """t = (c - n·p) / (n·v); a ray in the plane or parallel to it misses."""
        normal = positions.new_tensor(self.normal)
        slope = directions @ normal
        t = (self.offset - positions @ normal) / torch.where(slope == 0, torch.ones_like(slope), slope)
        return primitives._inf_unless(t, (slope != 0) & (t >= 0)), normal.expand_as(positions)

    def outward_curvatures(self, points: Float[Tensor, "n 3"], outward: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
        """Zero."""
        return points.new_zeros(len(points), 2)


@dataclass(frozen=True)
class Torus:
    """A tube of radius `minor` around the circle of radius `major` in the plane y = 0."""

    major: float = 0.7
    minor: float = 0.3

    def _implicit(self, x: Float[Tensor, "n 3"]) -> Float[Tensor, "n"]:
        inner = (x**2).sum(-1) + self.major**2 - self.minor**2
        return inner**2 - 4 * self.major**2 * (x[:, 0] ** 2 + x[:, 2] ** 2)

    def _gradient(self, x: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        inner = (x**2).sum(-1, keepdim=True) + self.major**2 - self.minor**2
        return 4 * inner * x - 8 * self.major**2 * x * x.new_tensor([1.0, 0.0, 1.0])

    def first(
        self, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Float[Tensor, "n 3"]]:
        """First root of the quartic along the ray, then two Newton steps that carry the derivatives in p and v.

        A Newton step from an exact root has the root's first derivatives, two have them up to the third.
        """
        with torch.no_grad():
            found, ahead = self._first_root(positions, directions)
        t = found
        for _ in range(2):
            x = positions + t[:, None] * directions
            slope = (self._gradient(x) * directions).sum(-1)
            flat = slope.abs() < 1e-9  # a grazing root has no derivative, and Newton would leave it
            t = torch.where(flat, t, t - self._implicit(x) / torch.where(flat, torch.ones_like(slope), slope))
        gradient = self._gradient(positions + t[:, None] * directions)
        return primitives._inf_unless(t, ahead), torch.nn.functional.normalize(gradient, dim=-1)

    def _first_root(
        self, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"]
    ) -> tuple[Float[Tensor, "n"], Bool[Tensor, "n"]]:
        """Real roots of t⁴ + c2 t² + c1 t + c0 as eigenvalues of its companion matrix.

        t counts from the ray's point nearest the centre: that removes t³ and keeps the coefficients small for far
        cameras.
        """
        shift = -(positions * directions).sum(-1)
        o, flat = positions + shift[:, None] * directions, positions.new_tensor([1.0, 0.0, 1.0])
        k = (o**2).sum(-1) + self.major**2 - self.minor**2
        four = 4 * self.major**2
        c2 = 2 * k - four * (directions**2 @ flat)
        c1 = -2 * four * ((o * directions) @ flat)
        c0 = k**2 - four * (o**2 @ flat)
        companion = positions.new_zeros(len(positions), 4, 4)
        companion[:, 1:, :3] = torch.eye(3, dtype=positions.dtype)
        companion[:, 0, 3], companion[:, 1, 3], companion[:, 2, 3] = -c0, -c1, -c2
        roots = torch.linalg.eigvals(companion)
        near_enough = (o**2).sum(-1) <= (self.major + self.minor) ** 2
        t = roots.real + shift[:, None]
        good = (roots.imag.abs() < _REAL_ROOT) & (t >= 0) & near_enough[:, None]
        first = torch.where(good, t, torch.inf).amin(-1)
        hit = torch.isfinite(first)
        return torch.where(hit, first, torch.zeros_like(first)), hit

    def outward_curvatures(self, points: Float[Tensor, "n 3"], outward: Float[Tensor, "n 3"]) -> Float[Tensor, "n 2"]:
        """-1/r along the tube's circle, -cos θ / (R + r cos θ) around the axis, which is positive on the inner half."""
        ring = torch.sqrt(points[:, 0] ** 2 + points[:, 2] ** 2)
        cosine = (ring - self.major) / self.minor
        safe = torch.where(ring > 0, ring, torch.ones_like(ring))
        return torch.stack([torch.full_like(ring, -1.0 / self.minor), -cosine / safe], dim=-1)


@dataclass(frozen=True)
class ClosedForm:
    """A `framed_field.FramedField`; lower, upper: a box a little larger than the surface, or rounding may miss it."""

    shape: primitives.Primitive
    lower: Float[np.ndarray, "3"] = field(default_factory=lambda: np.full(3, -1.01))
    upper: Float[np.ndarray, "3"] = field(default_factory=lambda: np.full(3, 1.01))

    @property
    def field_from_mesh(self) -> transforms.Similarity:
        """The closed form has one frame."""
        return transforms.Similarity()

    @property
    def outputs(self) -> tuple[str, ...]:
        """What closed forms know."""
        return "visibility", "depth", "normals", "mean_curvature", "gaussian_curvature"

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs; depth `inf` and all else 0 on a miss."""
        points = rays.OrientedPoints(torch.from_numpy(positions), torch.from_numpy(directions))
        hits = primitives.cast(self.shape, points)
        found = {"visibility": hits.visible.double(), "depth": hits.depth, "normals": hits.normals}
        if {"mean_curvature", "gaussian_curvature"} & set(outputs):
            both = primitives.curvatures(self.shape, points)
            found |= {"mean_curvature": both.sum(-1), "gaussian_curvature": both.prod(-1)}
        return {name: found[name].numpy() for name in outputs}

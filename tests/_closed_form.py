"""A closed form asked as a fitted field is."""

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float

from ddf.geometry import primitives, rays, transforms


@dataclass(frozen=True)
class ClosedForm:
    """A `framed_field.FramedField`; lower, upper: a box a little larger than the surface, or rounding may miss it."""

    shape: primitives.Primitive
    lower: Float[np.ndarray, "3"] = field(default_factory=lambda: np.full(3, -1.01))
    upper: Float[np.ndarray, "3"] = field(default_factory=lambda: np.full(3, 1.01))
    field_from_mesh: transforms.Similarity = field(default_factory=transforms.Similarity)

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

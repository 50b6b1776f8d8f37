"""Triangles that points are drawn from."""

import functools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.mesh_io import Mesh, face_normals


@dataclass(frozen=True)
class Surface:
    """Triangles ready for drawing points uniform by area; those without an area get none.

    Raises:
      InputError: no triangle has an area.
    """

    corners: Float[np.ndarray, "m 3 3"]
    normals: Float[np.ndarray, "m 3"]
    areas: Float[np.ndarray, "m"]

    def __post_init__(self) -> None:
        if not self.areas.sum() > 0:
            raise checks.InputError("the mesh must have a triangle with an area; got none")

    @classmethod
    def of(cls, mesh: Mesh) -> "Surface":
        """All triangles of a mesh."""
        return cls(mesh.triangles, *face_normals(mesh))

    @functools.cached_property
    def _ends(self) -> Float[np.ndarray, "m"]:
        return np.cumsum(self.areas)

    @functools.cached_property
    def _last(self) -> int:
        """The last triangle with an area."""
        return int(np.flatnonzero(self.areas > 0)[-1])

    @functools.cached_property
    def _frames(self) -> Float[np.ndarray, "m 9"]:
        """First corner, and the edges from it to the others."""
        first, second, third = (self.corners[:, corner] for corner in range(3))
        return np.concatenate([first, second - first, third - first], axis=1)

    def draw(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, "count 3"], Int[np.ndarray, "count"]]:
        """Points, of the type of the corners, and the triangle of each, in random order."""
        steps = np.cumsum(rng.standard_exponential(count + 1))  # over their end: uniform numbers in ascending order
        face = np.searchsorted(self._ends * (steps[-1] / self._ends[-1]), steps[:-1], side="right")
        np.minimum(face, self._last, out=face)  # whatever rounding says
        rng.shuffle(face)
        kind = self.corners.dtype
        root, along = np.sqrt(rng.random(count)).astype(kind), rng.random(count).astype(kind)
        second = root * along
        first = root - second
        rows = self._frames.take(face, axis=0).T
        points = np.zeros((3, count), kind)
        for axis, point in enumerate(points):
            np.multiply(first, rows[3 + axis], out=point)
            point += rows[axis]
            point += second * rows[6 + axis]
        return points.T, face

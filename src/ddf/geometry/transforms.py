"""Frames and scales: one invertible type for all of them.

Frames: mesh (the file's own) | v1 (ShapeNet OBJ: Y up, box centred at 0, diagonal 1) | field (box centred at 0, longest
side exactly 2) | benchmark (0.57 x v1, see `cameras`). Everything here is float64 numpy: centring and scaling happen
before any narrowing to float32.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.core import checks

_SIMILAR = 1e-6  # by how much a matrix may differ from scale times rotation: float32 files are within 1e-7
BENCHMARK_FROM_V1 = 0.57  # 1/1.75 rounded; published numbers are in these units (docs/formats.md)


@dataclass(frozen=True)
class Similarity:
    """y = scale R x + translation; InputError where the scale is not positive and finite, or the rotation is not
    orthonormal with determinant 1.
    """

    scale: float = 1.0
    rotation: Float[np.ndarray, "3 3"] = field(default_factory=lambda: np.eye(3))
    translation: Float[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "scale", float(self.scale))
        object.__setattr__(self, "rotation", np.asarray(self.rotation, dtype=np.float64))
        object.__setattr__(self, "translation", np.asarray(self.translation, dtype=np.float64))
        if self.rotation.shape != (3, 3) or self.translation.shape != (3,):
            raise checks.InputError(
                f"a rotation is 3x3, a translation 3 numbers; got {self.rotation.shape}, {self.translation.shape}"
            )
        if not 1e-100 <= self.scale <= 1e100:  # its square is finite, and that of its inverse
            raise checks.InputError(f"scale must be positive, in 1e-100..1e100; got {self.scale}")
        checks.require_finite("translation", self.translation)
        residual = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if not (residual <= 1e-9 and np.linalg.det(self.rotation) > 0):
            raise checks.InputError(f"rotation must be orthonormal with determinant 1; residual {residual:.3g}")

    def apply(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Transform points, in float64."""
        return self.scale * (np.asarray(points, dtype=np.float64) @ self.rotation.T) + self.translation

    def apply_directions(self, directions: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
        """Rotate directions or normals; lengths stay."""
        return np.asarray(directions, dtype=np.float64) @ self.rotation.T

    def scale_depth(self, depth: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
        """Scale distances along a ray; `inf` stays `inf`."""
        return np.asarray(depth, dtype=np.float64) * self.scale

    def inverse(self) -> "Similarity":
        """x = R^T (y - translation) / scale."""
        rotation = self.rotation.T
        return Similarity(1.0 / self.scale, rotation, -(rotation @ self.translation) / self.scale)

    def compose(self, inner: "Similarity") -> "Similarity":
        """The map x -> self(inner(x))."""
        return Similarity(self.scale * inner.scale, self.rotation @ inner.rotation, self.apply(inner.translation))

    def to_dict(self) -> dict:
        """Plain numbers for JSON, exact to the last bit."""
        return {
            "scale": self.scale,
            "rotation": self.rotation.tolist(),
            "translation": self.translation.tolist(),
        }

    @classmethod
    def from_dict(cls, values: dict) -> "Similarity":
        """The inverse of `to_dict`."""
        return cls(values["scale"], np.array(values["rotation"]), np.array(values["translation"]))

    @classmethod
    def of_matrix(cls, name: str, matrix: Any, tolerance: float = _SIMILAR) -> "Similarity":
        """From a 4x4 matrix, which differs from scale times rotation by no more than that share of the scale;
        InputError of another, such as one that shears or mirrors.
        """
        array = checks.require_numbers(name, matrix, (4, 4))
        if not np.array_equal(array[3], [0, 0, 0, 1]):
            turned = np.array_equal(array[:, 3], [0, 0, 0, 1])
            hint = "its translation stands in the last row: transpose it" if turned else f"got {array[3].tolist()}"
            raise checks.InputError(f"{name} must be a 4x4 matrix whose last row is 0, 0, 0, 1; {hint}")
        linear = array[:3, :3]
        scale = float(np.cbrt(np.linalg.det(linear)))
        if scale <= 0 or np.abs(linear @ linear.T - scale**2 * np.eye(3)).max() > tolerance * scale**2:
            raise checks.InputError(f"{name} must scale all axes alike, turn and move; this one shears or mirrors")
        left, _, right = np.linalg.svd(linear)  # the nearest rotation
        return cls(scale, left @ right, array[:3, 3])

    def to_matrix(self) -> Float[np.ndarray, "4 4"]:
        """The 4x4 matrix."""
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = self.scale * self.rotation, self.translation
        return matrix


def field_from_mesh(vertices: Float[np.ndarray, "n 3"]) -> Similarity:
    """The map that centres the vertices' box at 0 and makes its longest side exactly 2. Source: [DDF22] app. B.
    InputError where there is no such box.
    """
    checks.require_vectors("vertices", vertices)
    if len(vertices) == 0:
        raise checks.InputError("vertices must hold at least one point; got none")
    checks.require_finite("vertices", vertices)
    vertices = np.asarray(vertices, dtype=np.float64)
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    longest = float((upper - lower).max())
    if longest <= 0:
        raise checks.InputError("vertices must span a box; all of them coincide")
    scale = 2.0 / longest
    return Similarity(scale, np.eye(3), -scale * (lower + (upper - lower) / 2))


def rotation_of(xyzw: Float[np.ndarray, "4"]) -> Float[np.ndarray, "3 3"]:
    """That of a quaternion of any length but 0, the real part last."""
    x, y, z, w = xyzw / float(np.linalg.norm(xyzw))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def box_corners(lower: Float[np.ndarray, "3"], upper: Float[np.ndarray, "3"]) -> Float[np.ndarray, "8 3"]:
    """The corners of an axis-aligned box; the first is `lower`, the last `upper`."""
    return np.stack(np.meshgrid(*zip(lower, upper, strict=True), indexing="ij"), -1).reshape(8, 3)

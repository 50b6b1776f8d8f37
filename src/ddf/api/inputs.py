"""What users give, as the arrays that the library takes; a wrong shape is one ValueError in one line."""

from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry import rays, transforms

_SIMILAR = 1e-6  # by how much a matrix may differ from scale times rotation: float32 files are within 1e-7


def points(name: str, values: Any) -> Float[np.ndarray, "n 3"]:
    """Numbers of shape (n, 3), finite, as float64.

    Raises:
      InputError: something else.
    """
    array = np.asarray(values)
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise checks.InputError(f"{name} must be numbers of shape (n, 3); got {array.dtype} of shape {array.shape}")
    checks.require_finite(name, array)
    return array.astype(np.float64)


def oriented_points(positions: Any, directions: Any) -> rays.OrientedPoints[np.ndarray]:
    """Positions and directions of one shape (n, 3), float64; directions within 1e-4 of unit length become of it.

    Raises:
      InputError: something else.
    """
    starts, along = points("positions", positions), points("directions", directions)
    if len(starts) != len(along):
        raise checks.InputError(f"positions and directions must be as many; got {len(starts)} and {len(along)}")
    return rays.unit_points(starts, along)


def similarity(matrix: Any) -> transforms.Similarity:
    """A 4x4 matrix of a scaling, a rotation and a translation.

    Raises:
      InputError: something else, such as a matrix that shears or mirrors.
    """
    if isinstance(matrix, transforms.Similarity):
        return matrix
    array = np.asarray(matrix)
    if array.shape != (4, 4) or array.dtype.kind not in "fiu" or not np.array_equal(array[3], [0, 0, 0, 1]):
        raise checks.InputError(
            f"a transform must be a 4x4 matrix whose last row is 0, 0, 0, 1; got shape {array.shape}"
        )
    checks.require_finite("a transform", array)
    linear = array[:3, :3].astype(np.float64)
    scale = float(np.cbrt(np.linalg.det(linear)))
    if scale <= 0 or np.abs(linear @ linear.T - scale**2 * np.eye(3)).max() > _SIMILAR * scale**2:
        raise checks.InputError("a transform must scale all axes alike, turn and move; this one shears or mirrors")
    left, _, right = np.linalg.svd(linear)  # the nearest rotation
    return transforms.Similarity(scale, left @ right, array[:3, 3])

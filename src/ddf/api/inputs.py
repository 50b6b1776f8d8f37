"""What users give, as the arrays that the library takes; a wrong shape is one ValueError in one line."""

from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry import rays, transforms


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


def poses(name: str, matrices: Any) -> list[transforms.Similarity]:
    """One 4x4 matrix or several, (k, 4, 4), of that name.

    Raises:
      InputError: something else, such as a matrix that shears or mirrors, or none.
    """
    array = np.asarray(matrices)
    if array.ndim == 3 and not len(array):
        raise checks.InputError(f"{name} must be a 4x4 matrix or several; got none")
    return [transforms.Similarity.of_matrix(name, each) for each in (array if array.ndim == 3 else [array])]


def similarity(matrix: Any) -> transforms.Similarity:
    """A 4x4 matrix of a scaling, a rotation and a translation.

    Raises:
      InputError: something else, such as a matrix that shears or mirrors.
    """
    if isinstance(matrix, transforms.Similarity):
        return matrix
    return transforms.Similarity.of_matrix("a transform", matrix)

"""Parts of a scene: each put in its place by the product of the transforms above it, then all of them one mesh."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.formats import raw

Part = tuple[Float[np.ndarray, "_ 3"], Int[np.ndarray, "_ 3"]]  # vertices and triangles


def placed(vertices: Float[np.ndarray, "n 3"], faces: Int[np.ndarray, "m 3"], matrix: Float[np.ndarray, "4 4"]) -> Part:
    """The part moved by x -> M x; a mirroring transform turns its triangles, so that they still face outwards."""
    raw.require_coordinates(vertices)
    if (matrix == np.eye(4)).all():
        return vertices, faces
    with np.errstate(over="ignore", invalid="ignore"):  # `joined` refuses what is not finite
        moved = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
    return moved, faces[:, ::-1] if mirrored else faces


def joined(found: Sequence[Part], remarks: Sequence[str]) -> raw.Raw:
    """All parts as one mesh, in their order."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in found)])
    vertices = np.concatenate([np.zeros((0, 3)), *(vertices for vertices, _ in found)])
    raw.require_coordinates(vertices)
    faces = [faces + offset for (_, faces), offset in zip(found, offsets[:-1], strict=True)]
    return raw.Raw(vertices, np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces]), tuple(remarks))


def counted(total: int, more: int) -> int:
    """The sum of both.

    Raises:
      InputError: it is more than 20 million triangles, as scenes can claim that use one part many times.
    """
    if total + more > raw.MAX_TRIANGLES:
        raise checks.InputError(f"the scene has more than {raw.MAX_TRIANGLES} triangles")
    return total + more


def numbers(values: Any, count: int, name: str) -> Float[np.ndarray, "k"]:
    """`count` finite numbers of at most 1e100, as a node gives them."""
    right = isinstance(values, list | tuple) and len(values) == count
    if not right or not all(isinstance(v, int | float) and abs(v) <= raw.LARGEST for v in values):
        raise checks.InputError(f"{name} of a node must be {count} finite numbers")
    return np.array(values, dtype=np.float64)

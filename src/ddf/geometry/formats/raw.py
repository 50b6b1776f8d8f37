"""What every reader returns, and the checks that all of them share."""

from array import array
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, Num

from ddf.core import checks
from ddf.geometry.formats import polygons

LARGEST = 1e100  # of a coordinate: squares and volumes of larger ones leave float64
MAX_VERTICES = 16_000_000
MAX_CORNERS = 24_000_000  # of all polygons of a file
MAX_TRIANGLES = 20_000_000  # of scenes that use one part many times: 1 GiB in memory


class Raw(NamedTuple):
    """Vertices and triangles in the file's frame and order, and what the reader left out, one line each."""

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    remarks: tuple[str, ...] = ()


def require_room(kind: str, claimed: int, least_bytes: int, available: int) -> None:
    """Raise if the header claims more than the bytes that follow can hold."""
    if claimed < 0 or claimed * least_bytes > available:
        raise checks.InputError(f"the header claims {claimed} {kind}, but the file has only {available} bytes for them")


def require_few(vertices: int = 0, corners: int = 0) -> None:
    """Raise unless so many vertices, and corners of all polygons together, fit in memory."""
    for kind, count, most in (("vertices", vertices, MAX_VERTICES), ("corners", corners, MAX_CORNERS)):
        if count > most:
            raise checks.InputError(f"the file has {count} {kind}; at most {most} are read")


def widened(values: Num[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Numbers as float64; that some are no numbers is told later, in one line."""
    with np.errstate(invalid="ignore"):
        return np.asarray(values, dtype=np.float64)


def require_coordinates(vertices: Float[np.ndarray, "n 3"]) -> None:
    """Raise unless all coordinates are finite and no larger than 1e100."""
    checks.require_finite("vertices", vertices)
    largest = max(float(vertices.max(initial=0.0)), -float(vertices.min(initial=0.0)))
    if largest > LARGEST:
        raise checks.InputError(f"a coordinate is {largest:g}; must be at most {LARGEST:g}")


def of_polygons(
    vertices: array | Float[np.ndarray, "n 3"],
    counts: Sequence[int] | array | Int[np.ndarray, "p"],
    corners: Sequence[int] | array | Int[np.ndarray, "c"],
    remarks: tuple[str, ...] = (),
    refuse: bool = True,
) -> Raw:
    """Triangles of polygons: corners one polygon after the other, `counts` of them each; under three are dropped.

    refuse: as of `polygons.triangulate`.
    """
    require_few(len(vertices) // 3 if isinstance(vertices, array) else len(vertices), len(corners))
    positions = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    sizes, index = (np.asarray(each, dtype=np.int64).view(np.int64) for each in (counts, corners))  # of array: longlong
    require_coordinates(positions)
    if len(index) and not (0 <= index.min() and index.max() < len(positions)):
        bad = int(index.min()) if index.min() < 0 else int(index.max()) + 1
        raise checks.InputError(f"a face uses vertex {bad}, but there are only {len(positions)}")
    dropped = int((sizes < 3).sum())
    if dropped:
        index, sizes = index[np.repeat(sizes >= 3, sizes)], sizes[sizes >= 3]
        remarks = (*remarks, f"{dropped} faces of fewer than three corners are left out")
    faces, crossing = polygons.triangulate(positions, sizes, index, refuse)
    if crossing:
        remarks = (*remarks, f"{crossing} polygons cross themselves: cut from their first corner")
    return Raw(positions, faces, remarks)

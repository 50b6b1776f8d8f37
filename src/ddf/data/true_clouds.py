"""Ground-truth point clouds: Poisson-disk samples of the raw mesh, hidden inner faces included.

As the official clouds of Pixel2Mesh: drawn on all faces, about 8,000 points, none closer than a radius to another.
`hidden` marks points that no ray from outside meets first. Own dart throwing: it is seeded by a numpy generator
(Open3D's and MeshLab's are seeded globally), and several times faster than Open3D's sample elimination.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import spatial

from ddf.data import packing
from ddf.data.samples.draws import Surface
from ddf.geometry import raycast
from ddf.geometry.mesh_io import Mesh, face_normals

_CANDIDATES = 6  # per point wanted: enough darts for a set that is nearly maximal
_DENSITY = 0.47  # points of a set, times radius squared, by area: 0.6 on planes, 0.45 to 0.52 on shapes with thin parts
_TOLERANCE = 0.1  # of the count wanted; official clouds have 7 to 9 thousand points
_MAX_ROUNDS = 16  # one or two do, but for threads
_CELLS = 1 << 13  # at most along each axis, so that float32 places are good to 1/1000 of a cell
_WIDER = 1 + 1e-5  # the tree proposes pairs in float64, float32 decides


def draw(mesh: Mesh, count: int, rng: np.random.Generator) -> packing.Cloud:
    """A Poisson-disk cloud of `count` points within 10 % and the visibility of each (64 rays, see `raycast`)."""
    points, face = poisson_disk(mesh, count, rng)
    hidden = ~raycast.visible_from_outside(raycast.Scene(mesh), points, face)
    return packing.Cloud(points.astype(np.float32), hidden)


def poisson_disk(
    mesh: Mesh, count: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "n"]]:
    """Points of which no two are closer than a radius, chosen so that the count is met within 10 %, and their
    triangles.

    The darts are drawn once; the radius is corrected until the count fits (distances are between points in space, so
    sheets closer than the radius share their points).
    """
    darts, face = Surface.of(mesh).draw(_CANDIDATES * count, rng)
    radius = np.sqrt(_DENSITY * face_normals(mesh)[1].sum() / count)
    kept = _throw(darts, radius)
    for _ in range(_MAX_ROUNDS - 1):
        if abs(len(kept) - count) <= _TOLERANCE * count:
            break
        radius *= np.sqrt(len(kept) / count)
        kept = _throw(darts, radius)
    return darts[kept], face[kept]


def _throw(darts: Float[np.ndarray, "n 3"], radius: float) -> Int[np.ndarray, "k"]:
    """Indices of the darts that stay when they are thrown in order and each must keep `radius` from those before it."""
    from_corner = darts - darts.min(axis=0)
    cell = max(radius, from_corner.max(initial=0.0) / _CELLS)
    places = (from_corner / cell).astype(np.float32)
    early, late = spatial.cKDTree(places).query_pairs(_WIDER * radius / cell, output_type="ndarray").T
    apart = places.take(early, axis=0) - places.take(late, axis=0)
    close = np.einsum("ij,ij->i", apart, apart) <= (radius / cell) ** 2
    return np.flatnonzero(_first_come(early[close], late[close], len(darts)))


def _first_come(early: Int[np.ndarray, "p"], late: Int[np.ndarray, "p"], count: int) -> Bool[np.ndarray, "count"]:
    """Which of `count` darts stay, given the pairs that are too close.

    In rounds over all pairs at once: a dart that no undecided earlier one is near stays, its later neighbours go.
    """
    undecided, stays = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    while len(early):
        waits = np.zeros(count, dtype=bool)
        waits[late] = True
        accepted = undecided & ~waits
        stays |= accepted
        undecided &= waits
        undecided[late[accepted[early]]] = False
        live = undecided[early] & undecided[late]
        early, late = early[live], late[live]
    return stays | undecided

"""Ground-truth point clouds: Poisson-disk samples of the raw mesh, hidden inner faces included.

As the official clouds of Pixel2Mesh: drawn on all faces, about 8,000 points, none closer than a radius to another.
`hidden` marks points that no ray from outside meets first. Own dart throwing: it is seeded by a numpy generator
(Open3D's and MeshLab's are seeded globally), and several times faster than Open3D's sample elimination.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf.data import packing
from ddf.data.samples.draws import Surface
from ddf.geometry import raycast
from ddf.geometry.mesh_io import Mesh, face_normals

_CANDIDATES = 6  # per point wanted: enough darts for a set that is nearly maximal
_DENSITY = 0.47  # points of a set, times radius squared, by area: 0.6 on planes, 0.45 to 0.52 on shapes with thin parts
_TOLERANCE = 0.1  # of the count wanted; official clouds have 7 to 9 thousand points
_MAX_ROUNDS = 16  # one or two do, but for threads
_ROWS = 1 << 16  # starts of rows of cells, shared by a hash: more would leave the processor's cache
_CELLS = 1 << 13  # at most along each axis, so that float32 places are good to 1/1000 of a cell
_HASH = (np.int32(73856093), np.int32(19349663))  # Teschner et al. 2003, "Optimized spatial hashing"; products wrap


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

    Raises:
      InputError: no triangle has an area.
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
    """Indices of the darts that stay when they are thrown in order and each must keep `radius` from those before it.

    In portions: darts near one that stayed from an earlier portion go at once, so that few pairs are left to compare.
    """
    from_corner = darts - darts.min(axis=0)
    cell = max(radius, from_corner.max(initial=0.0) / _CELLS)
    places = (from_corner / cell).astype(np.float32)
    grid = _Grid(places, places.astype(np.int32).T, radius / cell)
    stay = np.zeros(0, dtype=np.intp)
    for portion in np.array_split(np.arange(len(darts)), _CANDIDATES):
        near, _ = grid.near(portion, stay)
        free = np.ones(len(portion), dtype=bool)
        free[near] = False
        portion = portion[free]
        one, other = grid.near(portion, portion)
        early = one < other
        stay = np.concatenate([stay, portion[_first_come(one[early], other[early], len(portion))]])
    return stay


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


@dataclass(frozen=True)
class _Grid:
    """Places in units of a cell, the cells that they lie in, and how far apart is near (at most 1).

    The cells of a row along x follow each other in one list, from a start that rows share by a hash.
    """

    places: Float[np.ndarray, "n 3"]
    cells: Int[np.ndarray, "3 n"]
    reach: float

    def near(
        self, asking: Int[np.ndarray, "a"], known: Int[np.ndarray, "b"]
    ) -> tuple[Int[np.ndarray, "p"], Int[np.ndarray, "p"]]:
        """Pairs of positions in `asking` and in `known` of places no further apart than that: 27 cells in 9 rows."""
        x, y, z = self.cells.take(known, axis=1)
        in_list = _row(y * _HASH[0], z * _HASH[1]) + x
        order = np.argsort(in_list, kind="stable").astype(np.int32)
        length = _ROWS + int(self.cells[0].max(initial=0)) + 3
        starts = np.concatenate([[0], np.cumsum(np.bincount(in_list, minlength=length))]).astype(np.int32)
        x, y, z = self.cells.take(asking, axis=1)
        rows_y, rows_z = [(y + i) * _HASH[0] for i in (-1, 0, 1)], [(z + i) * _HASH[1] for i in (-1, 0, 1)]
        before = np.concatenate([_row(a, b) + x for a in rows_y for b in rows_z]) - 1
        begin = starts.take(before)
        counts = starts.take(before + 3) - begin
        one = np.repeat(np.tile(np.arange(len(asking), dtype=np.int32), 9), counts)
        skip = (begin - (np.cumsum(counts) - counts)).astype(np.int32)
        other = order.take(np.arange(len(one), dtype=np.int32) + np.repeat(skip, counts))
        apart = self.places.take(asking.take(one), axis=0)
        apart -= self.places.take(known.take(other), axis=0)
        close = np.flatnonzero(np.einsum("ij,ij->i", apart, apart) <= self.reach**2)
        return one[close], other[close]


def _row(y: Int[np.ndarray, "a"], z: Int[np.ndarray, "a"]) -> Int[np.ndarray, "a"]:
    return ((y ^ z) & (_ROWS - 1)) + 1

"""A closed mesh of what looks at a field from many sides say (derived here, after Curless and Levoy 1996).

From each side a depth image is taken, half as fine as the nodes of a grid. Each node has the mean of how far in front
of what its pixels see it is, up to `REACH`; a look that sees nothing there, or ends before the node, counts less, so
that some that err cut no leg off and leave no speck. Where the mean is `LEVEL` lies the surface, so that sheets which
look thinner than nothing from both sides stay; its vertices go back a little. Hollows that few sides look into are
full.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage, sparse

from ddf.core import checks
from ddf.geometry import mesh_io, rays, unsigned_surface

# starts (n, 3), unit directions (n, 3) -> depth (n), inf where nothing is seen
Look = Callable[[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]], Float[np.ndarray, "n"]]
LEVEL = 0.8  # cells
_SIDES = 32
_PIXEL = 2.0  # cells
REACH = 3.0  # cells: distances that count
_MARGIN = 2  # cells around the box
_MISSED, _HIDDEN = 0.5, 0.1  # weights of looks that see nothing, and of those that end far before
_BLUR = 0.5  # cells
_BACK = 0.4  # cells: looks that graze are farther in front than the surface is away
_ROUNDS, _IN, _OUT = 3, 0.5, -0.53  # of smoothing. Source: Taubin 1995
_SLIGHTLY = 0.05  # cells


@dataclass(frozen=True)
class Grid:
    """Nodes in steps of `cell` from `origin` on, so many along each axis."""

    origin: Float[np.ndarray, "3"]
    cell: float
    shape: tuple[int, ...]

    @classmethod
    def around(cls, lower: Float[np.ndarray, "3"], upper: Float[np.ndarray, "3"], resolution: int) -> "Grid":
        """Of a box with a margin, its longest side so many cells."""
        cell = float((upper - lower).max()) / resolution
        counts = np.ceil((upper - lower) / cell).astype(int) + 2 * _MARGIN + 1
        return cls(lower - _MARGIN * cell, cell, tuple(counts.tolist()))

    def nodes(self) -> Float[np.ndarray, "n 3"]:
        """All of them, z fastest."""
        return self.origin + self.cell * np.indices(self.shape).reshape(3, -1).T


class Votes:
    """What looks say of some nodes of a grid."""

    def __init__(self, grid: Grid, chosen: Int[np.ndarray, "n"]) -> None:
        self.grid, self.chosen, self.nodes = grid, chosen, grid.nodes()[chosen].astype(np.float32)
        self._sum, self._weight = np.zeros((2, len(chosen)), np.float32)

    def add(self, ahead: Float[np.ndarray, "n"], weight: float = 1.0) -> None:
        """One look: how far what it sees lies behind each node, in the grid's unit; inf where it sees nothing."""
        cells = np.clip(ahead / self.grid.cell, -REACH, REACH).astype(np.float32)
        counted = np.clip(1 + cells / REACH, _HIDDEN, 1)
        counted[~np.isfinite(ahead)] = _MISSED
        self._sum += weight * counted * cells
        self._weight += weight * counted

    def look_around(self, look: Look) -> None:
        """Parallel looks from all sides, a ray for each pixel that a node lies in."""
        cell = _PIXEL * self.grid.cell
        for way in rays.evenly_spread(_SIDES):
            right = np.linalg.svd(way[None])[2][1:]  # two axes across
            flat, far = right.astype(np.float32) @ self.nodes.T, self.nodes @ way.astype(np.float32)
            low, start = flat.min(axis=1), far.min() - cell
            row, column = np.rint((flat - low[:, None]) / cell).astype(np.int32)
            height, width = row.max() + 1, column.max() + 1
            pixel = row * width + column
            used = np.flatnonzero(np.bincount(pixel))
            starts = (low + cell * np.stack(divmod(used, width), axis=1)) @ right + start * way
            seen = np.full(height * width, np.inf)
            seen[used] = start + look(starts, np.broadcast_to(way, starts.shape).copy())
            self.add(seen[pixel] - far)

    def mean(self) -> Float[np.ndarray, "n"]:
        """Of the nodes, in cells and a little blurred; negative inside."""
        whole = np.zeros((2, np.prod(self.grid.shape)), np.float32)
        whole[:, self.chosen] = self._sum, self._weight
        blurred = (ndimage.gaussian_filter(each.reshape(self.grid.shape), _BLUR, truncate=2) for each in whole)
        total, weight = (each.ravel()[self.chosen] for each in blurred)
        return total / weight


def extract(look: Look, lower: Float[np.ndarray, "3"], upper: Float[np.ndarray, "3"], resolution: int) -> mesh_io.Mesh:
    """The closed surface in a box, in its frame, its longest side so many cells; InputError where nothing is left."""
    origin = mesh_io.told_origin(np.stack((lower, upper)))
    grid = Grid.around(lower - origin, upper - origin, resolution)
    votes = Votes(grid, np.arange(np.prod(grid.shape)))
    votes.look_around(lambda starts, ways: look(starts + origin, ways))
    mesh = surface(grid, votes.mean().reshape(grid.shape) - LEVEL, _BACK)
    return mesh_io.Mesh(mesh.vertices + origin, mesh.faces)


def surface(grid: Grid, values: Float[np.ndarray, "x y z"], back: float = 0.0) -> mesh_io.Mesh:
    """The closed surface where the values are 0, by surface nets, smoothed; below 0 is inside, the rim is outside.
    The vertices go `back` by so many cells; InputError where no node is inside.
    """
    values = np.pad(values[1:-1, 1:-1, 1:-1], 1, constant_values=REACH)
    if not (values < 0).any():
        raise checks.InputError("nothing is left that all sides see: fit the field for longer")
    _join(values)
    values[ndimage.binary_fill_holes(values < 0) & (values >= 0)] = -_SLIGHTLY  # what no look reaches
    vertices, faces = unsigned_surface.net(*crossings(values), np.array(values.shape))
    vertices = _smoothed(vertices, faces)
    vertices -= back * mesh_io.vertex_normals(mesh_io.Mesh(vertices, faces))
    return mesh_io.Mesh(grid.origin + grid.cell * vertices, faces)


def crossings(
    values: Float[np.ndarray, "x y z"], told: Bool[np.ndarray, "x y z"] | None = None
) -> tuple[Float[np.ndarray, "c 3"], Int[np.ndarray, "c 4 3"]]:
    """Where edges of the grid cross 0, and the four cells around each: what `unsigned_surface.net` takes. Nodes that
    are `told` count, all where nothing is said, but for those at the rim.
    """
    told = np.ones_like(values, bool) if told is None else np.pad(told[1:-1, 1:-1, 1:-1], 1)
    places, cells = [], []
    for axis in range(3):
        step, one, other = (np.eye(3, dtype=int)[(axis + i) % 3] for i in range(3))
        inside, counts = np.moveaxis(values < 0, axis, 0), np.moveaxis(told, axis, 0)
        found = np.argwhere((inside[1:] != inside[:-1]) & counts[1:] & counts[:-1])
        first = np.insert(found[:, 1:], axis, found[:, 0], axis=1)
        begin, end = values[tuple(first.T)], values[tuple((first + step).T)]
        places.append(first + (begin / (begin - end))[:, None] * step)
        around = first[:, None] + np.stack([-one - other, -other, np.zeros(3, dtype=int), -one])
        cells.append(np.where((begin < 0)[:, None, None], around, around[:, ::-1]))
    return np.concatenate(places), np.concatenate(cells)


def _join(values: Float[np.ndarray, "x y z"]) -> None:
    """Put the likelier node between two inside that meet in a corner of their plane alone inside too, in place.

    Where there are none, each edge of the surface has two triangles.
    """
    corners, met = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1]]), True
    while met:
        met = False
        for axis in range(3):
            flat = np.moveaxis(values, axis, 0)
            square = np.stack([flat[:, :-1, :-1], flat[:, 1:, :-1], flat[:, 1:, 1:], flat[:, :-1, 1:]])
            inside = square < 0
            crossed = (inside[0] == inside[2]) & (inside[1] == inside[3]) & (inside[0] != inside[1])
            likelier = np.where(inside, np.inf, square)[:, crossed].argmin(axis=0)
            flat[tuple((np.argwhere(crossed) + corners[likelier]).T)] = -_SLIGHTLY
            met |= bool(crossed.any())


def _smoothed(vertices: Float[np.ndarray, "n 3"], faces: Int[np.ndarray, "m 3"]) -> Float[np.ndarray, "n 3"]:
    """Vertices moved towards the mean of their neighbours and back again, so that they do not shrink."""
    starts, ends = np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)]).T
    beside = sparse.csr_matrix((np.ones(len(starts)), (starts, ends)))
    count = np.bincount(starts)[:, None]
    for factor in _ROUNDS * (_IN, _OUT):
        vertices = vertices + factor * (beside @ vertices / count - vertices)
    return vertices

"""The surface that measured rays have in common, and what of space they saw.

Hits have the plane of those around them, turned to their sensor; a node of a grid is as far in front of the surface as
the mean of these planes says, f(x) = Σ w_i n_i · (x - q_i) / Σ w_i with a Gaussian w (Kolluri 2005, implicit moving
least squares). All sums are blurred grids, so that their cost does not grow with the hits. The grid is as fine as the
hits lie, or as coarse as their noise asks, which their scatter about the planes tells.

Rays carve: where they passed, nothing is. Near hits what no ray passed through is taken to be inside, which closes what
hits leave open; farther off nothing is said.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from ddf.core import checks, seeding
from ddf.geometry import carved_surface, grid_loops, mesh_io, scans, unsigned_surface

FEWEST = 50  # hits
_FINEST = 160  # nodes along the longest side
_MARGIN = 5  # nodes around the hits
_SPACING, _NOISE = 1.3, 0.9  # sides of a cell, in spacings of hits and in deviations of their noise
_PLANE, _MEAN = 1.8, 0.8  # widths of the Gaussians of planes and of f, in cells
_LEAST = 0.05  # of the median weight: that of a node that f is known at
_NEAR = 2.0  # cells: how far off f is known
_BESIDE = 1.1  # widths: a node so far beside the hits that its planes are of is not on the surface, if rays passed it
_CLOSED, _BLIND = 4, 2  # cells around hits in which what is open is closed; where no ray tells what is empty
_STRAY_CELLS = 64  # along the longest side of the hits
_STRAY, _STRAY_SHARE, _STRAY_MOST = (
    3,
    0.04,
    10,
)  # strays: fewer hits in 27 cells than the share of the median, in bounds
_LINE, _POINT = 1e-4, 1e-9  # of the length and of the coordinates: hits that are less wide span nothing
_ALONE = 8.5  # what a ray or two add up to in 27 nodes
_FEW = 0.2  # of the median number of rays through a node
_SPECK = 0.01  # of the largest free space
_MOST_CARVING = 600_000  # rays
_GRAZING = 0.7  # deviation across the surface over that along the rays, about


@dataclass(frozen=True)
class Fused:
    """The surface, frame and unit of the scan, open or closed; noise: deviation of hits across it.

    passed: nodes, from `origin` in steps of `cell`, that rays passed through; ended: nodes where hits tell the surface.
    """

    mesh: mesh_io.Mesh
    noise: float
    origin: Float[np.ndarray, "3"]
    cell: float
    passed: Bool[np.ndarray, "x y z"]
    ended: Bool[np.ndarray, "x y z"]

    def evidence(
        self, lows: Float[np.ndarray, "n 3"], side: float
    ) -> tuple[Bool[np.ndarray, "n"], Bool[np.ndarray, "n"]]:
        """Of cells, by least corners: whether rays passed most of it, and whether hits lie in it."""
        passed, ended = np.zeros((2, len(lows)))
        for part in np.indices((3, 3, 3)).reshape(3, -1).T:
            node = np.rint((lows + side * (part + 0.5) / 3 - self.origin) / self.cell).astype(int)
            index = tuple(np.clip(node, 0, np.array(self.passed.shape) - 1).T)
            passed += self.passed[index]
            ended += self.ended[index]
        return passed >= 27 / 2, ended > 0


def fuse(scan: scans.Scan, sensed: bool = True) -> Fused:
    """The surface of a scan; InputError where too few rays end on something, or on no surface. Unless they are
    `sensed`, rays do not tell what is free, and nothing of the surface is closed.
    """
    scan = without_strays(scan)
    points, ways = scan.points, scan.directions[scan.hit]
    cell = max(_SPACING * _spacing(points), float(np.ptp(points, axis=0).max()) / _FINEST)
    planes = _Planes(points, cell)
    if _NOISE * planes.noise > cell:
        planes = _Planes(points, _NOISE * planes.noise)
    cell, origin, shape = planes.cell, planes.origin, planes.shape
    normals = planes.normals * np.where((planes.normals * ways).sum(axis=1, keepdims=True) > 0, -1.0, 1.0)
    values, weight = _mean_distance(planes, normals)
    passed = _passed(scan, planes) & sensed
    near = (weight > _LEAST * np.median(weight[weight > _LEAST])) & (np.abs(values) < _NEAR)
    ended = near & ~(passed & (planes.beside > _BESIDE) & (values < 0))
    ahead, behind = ended & (values > 0), ended & (values < 0)
    wide = ndimage.maximum_filter(passed, 3) & ~ndimage.maximum_filter(behind, 3)
    passed = _connected(passed | ahead | wide)
    passed, ended = (passed, ended & (behind | passed)) if sensed else (ahead, ended)
    told = ndimage.maximum_filter(ended, 2 * (_BLIND if scan.hit.all() else _CLOSED) + 1) if sensed else ended
    values = np.where(ended, values, np.where(passed, 1.0, -1.0))
    places, quads = carved_surface.crossings(values, told)
    if not len(places):
        raise checks.InputError("the rays end on no surface: too few of them, or of another frame than they say")
    vertices, faces = unsigned_surface.net(places, quads, np.array(shape))
    mesh = mesh_io.Mesh(origin + cell * vertices, faces)
    return Fused(mesh, planes.noise, origin, cell, passed, ended)


def without_strays(scan: scans.Scan) -> scans.Scan:
    """Without the hits that have few others around them, nor their rays; InputError where hardly any are left."""
    points = scan.points
    if len(points) >= FEWEST:
        low, high = np.quantile(points, [0.02, 0.98], axis=0)
        side = float((high - low).max()) / _STRAY_CELLS
        inside = ((points >= low - (high - low) - side) & (points <= high + (high - low) + side)).all(axis=1)
        place = np.floor((points - points[inside].min(axis=0)) / max(side, 1e-300)).astype(int)[inside]
        counts = np.zeros(place.max(axis=0) + 1)
        np.add.at(counts, tuple(place.T), 1)
        around = ndimage.uniform_filter(counts, 3, mode="constant") * 27
        near = around[tuple(place.T)]
        least = float(np.clip(_STRAY_SHARE * np.median(near), _STRAY, _STRAY_MOST))
        together = near > least + 0.5
        kept, found = np.flatnonzero(scan.hit)[inside][together], points[inside][together]
        if len(kept) < FEWEST:
            told = f"{len(kept)} have {least:.0f} others within {1.5 * side:.3g}"
            raise checks.InputError(f"of {len(points)} hits {told}: too far apart for a surface")
        wide = np.sqrt(np.linalg.eigvalsh(np.cov(found.T)).clip(0))
        if wide[1] <= max(_LINE * wide[2], _POINT * np.abs(found).max()):
            raise checks.InputError(f"the {len(kept)} hits span nothing: they lie in one point or on one line")
        chosen = ~scan.hit
        chosen[kept] = True
        return scan.some(chosen)
    raise checks.InputError(f"{len(points)} hits: too few for a surface, which takes {FEWEST} or more")


def _spacing(points: Float[np.ndarray, "n 3"]) -> float:
    """Between neighbours on the surface, about: by how many cells of a coarse grid they lie in."""
    cell = float(np.ptp(points, axis=0).max()) / _STRAY_CELLS
    cells = np.unique(np.floor((points - points.min(axis=0)) / cell), axis=0)
    return cell * math.sqrt(0.7 * len(cells) / len(points))


class _Planes:
    """The planes of hits by principal axes of those around each, and the grid that they were found on.

    places: of the hits, in cells. beside: of nodes, how far the mean of the hits around is away, in widths.
    """

    def __init__(self, points: Float[np.ndarray, "n 3"], cell: float) -> None:
        self.cell, self.origin = cell, points.min(axis=0) - _MARGIN * cell
        self.places = (points - self.origin) / cell
        self.shape: tuple[int, ...] = tuple((np.ceil(self.places.max(axis=0)).astype(int) + _MARGIN + 1).tolist())
        pairs = np.triu_indices(3)
        moments = self.places[:, pairs[0]] * self.places[:, pairs[1]]
        sums = _blurred(np.concatenate([np.ones((len(points), 1)), self.places, moments], axis=1), self, _PLANE)
        nodes = np.ravel_multi_index(tuple(np.rint(self.places).astype(int).T), self.shape)
        own, back = np.unique(nodes, return_inverse=True)
        found = [each.ravel()[own] / sums[0].ravel()[own] for each in sums[1:]]
        spread = np.zeros((len(own), 3, 3))
        for each, i, j in zip(found[3:], *pairs, strict=True):
            spread[:, i, j] = spread[:, j, i] = each - found[i] * found[j]
        sizes, axes = np.linalg.eigh(spread)
        self.normals = axes[back, :, 0]
        across = max(float(np.median(sizes[back, 0])), 0.0)  # a Gaussian's window and the noise, both
        self.noise = cell / math.sqrt(max(1 / max(across, 1e-12) - 1 / _PLANE**2, 1e-6))
        total = np.maximum(sums[0], 1e-9)
        away = sum((index - each / total) ** 2 for index, each in zip(np.indices(self.shape), sums[1:4], strict=True))
        self.beside = np.sqrt(away) / _PLANE


def _blurred(values: Float[np.ndarray, "n c"], planes: "_Planes", width: float) -> list[Float[np.ndarray, "x y z"]]:
    """Sums of what hits carry, about the nodes of the grid."""
    grids = np.zeros((values.shape[1], *planes.shape))
    grid_loops.splat(planes.places, values, grids)
    return [ndimage.gaussian_filter(grid, width, truncate=2.5, mode="constant") for grid in grids]


def _mean_distance(
    planes: _Planes, normals: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, "x y z"], Float[np.ndarray, "x y z"]]:
    """f of the nodes, in cells, and the weights that it is of."""
    offsets = (normals * planes.places).sum(axis=1, keepdims=True)
    weight, *normal, offset = _blurred(np.concatenate([np.ones_like(offsets), normals, offsets], axis=1), planes, _MEAN)
    along = sum(index * each for index, each in zip(np.indices(planes.shape), normal, strict=True))
    return (along - offset) / np.maximum(weight, 1e-9), weight


def _connected(passed: Bool[np.ndarray, "x y z"]) -> Bool[np.ndarray, "x y z"]:
    """Without the specks that single rays with too long ranges make."""
    labels, _ = ndimage.label(passed)
    counts = np.bincount(labels.ravel())
    counts[0] = 0
    return (counts >= _SPECK * counts.max())[labels]


def _passed(scan: scans.Scan, planes: _Planes) -> Bool[np.ndarray, "x y z"]:
    """Nodes that rays passed through, which end a little before their hits; not those of a ray alone, where others have
    many: its range can be wrong.
    """
    chosen = slice(None)
    if len(scan.ranges) > _MOST_CARVING:
        chosen = seeding.generator(0, "rays that carve").permutation(len(scan.ranges))[:_MOST_CARVING]
    starts = (scan.positions[chosen] - planes.origin) / planes.cell
    before = 1.5 + 3 * planes.noise / _GRAZING / planes.cell
    counts = np.zeros(planes.shape, np.int32)
    grid_loops.carve(starts, scan.directions[chosen], scan.ranges[chosen] / planes.cell - before, counts)
    usual = float(np.median(counts[counts > 0])) if counts.any() else 0.0
    around = 27 * ndimage.uniform_filter(counts.astype(np.float32), 3, mode="constant")
    return (counts > 0) & (around > min(_ALONE, 27 * _FEW * usual))

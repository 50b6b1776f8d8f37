"""Nearest neighbours between point clouds in float64: by Open3D's KD-tree, or by SciPy's where there is no Open3D.

Both give the same squared distances, to the last bit. Open3D's is the faster one.
Open3D's tensor search keeps the dtype of its input and returns squared distances: float64 in, float64 out. With
float32 input the squared distances of clouds 1e-3 apart are wrong by 4e-4 relative (more away from the origin), so
everything is widened here. The legacy `compute_point_cloud_distance` returns unsquared distances, whose square no
longer equals a threshold exactly.
"""

import importlib.util

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks

LARGEST = 1e150  # its square, 1e300, still fits float64
CELLS = 31.99  # a side of the grid that clouds are ordered by: numbers 0 to 31, five bits


class Open3DTree:
    """Open3D's KD-tree over a cloud."""

    def __init__(self, points: Float[np.ndarray, "n 3"]) -> None:
        import open3d as o3d

        self._as_tensor = o3d.core.Tensor
        self._search = o3d.core.nns.NearestNeighborSearch(self._as_tensor(points))
        self._search.knn_index()

    def search(
        self, queries: Float[np.ndarray, "m 3"], count: int
    ) -> tuple[Int[np.ndarray, "m {count}"], Float[np.ndarray, "m {count}"]]:
        """Indices of the `count` nearest points of the cloud, nearest first, and their squared distances."""
        index, dist_sq = self._search.knn_search(self._as_tensor(queries), count)
        return index.numpy().view(np.int64), dist_sq.numpy()


class ScipyTree:
    """SciPy's, which tells distances that are not squared: these are computed anew."""

    def __init__(self, points: Float[np.ndarray, "n 3"]) -> None:
        from scipy import spatial

        self._points, self._tree = points, spatial.cKDTree(points)

    def search(
        self, queries: Float[np.ndarray, "m 3"], count: int
    ) -> tuple[Int[np.ndarray, "m {count}"], Float[np.ndarray, "m {count}"]]:
        """As `Open3DTree.search`."""
        index = self._tree.query(queries, list(range(1, count + 1)), workers=-1)[1]
        x, y, z = np.moveaxis(queries[:, None] - self._points[index], -1, 0)
        return index, x**2 + y**2 + z**2


def tree(points: Float[np.ndarray, "n 3"]) -> Open3DTree | ScipyTree:
    """A KD-tree of the library that is there."""
    return ScipyTree(points) if importlib.util.find_spec("open3d") is None else Open3DTree(points)


class Neighbours:
    """A searchable cloud: build once, query often.

    The tree is built over the points in Morton order (derived here: neighbours in space lie together in memory), which
    takes two thirds of the time of another order, as does a search for one such cloud in another. Results come in the
    order of what was given, and are the same in any order.

    Args:
      points: the cloud that is searched, any frame; copied to float64.
    Raises:
      InputError: no points, not three columns, or a value that is not finite.
    """

    def __init__(self, points: Float[np.ndarray, "n 3"], name: str = "points") -> None:
        points = validated(points, name)
        self._order = _morton_order(points)
        self.points = points[self._order]  # in that order
        self._tree = tree(self.points)

    def __len__(self) -> int:
        return len(self.points)

    def nearest(
        self, queries: Float[np.ndarray, "m 3"], name: str = "queries"
    ) -> tuple[Float[np.ndarray, " m"], Int[np.ndarray, " m"]]:
        """Squared distance to, and index of, the nearest point of the cloud for each query (ties: any of them)."""
        index, dist_sq = self._tree.search(validated(queries, name), 1)
        return dist_sq[:, 0], self._order[index[:, 0]]

    def dist_sq(
        self, queries: "Float[np.ndarray, 'm 3'] | Neighbours", name: str = "queries"
    ) -> Float[np.ndarray, " m"]:
        """Squared distance to the nearest point of the cloud for each query; another cloud is checked already."""
        if isinstance(queries, Neighbours):
            return queries._as_given(self._tree.search(queries.points, 1)[1][:, 0])
        return self._tree.search(validated(queries, name), 1)[1][:, 0]

    def spacing(self) -> Float[np.ndarray, " n"]:
        """Distance, not squared, from each point of the cloud to the nearest other one; 0 where a place is taken twice.
        InputError where it is a single point.
        """
        if len(self) < 2:
            raise checks.InputError("the spacing of a cloud needs two points or more; got 1")
        _, dist_sq = self._tree.search(self.points, 2)
        return np.sqrt(self._as_given(dist_sq[:, 1]))

    def _as_given(self, values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Values of `points` in the order in which the cloud came."""
        given = np.zeros_like(values)
        given[self._order] = values
        return given


def _morton_order(points: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, " n"]:
    """Indices along a Morton curve through a cubic grid over the cloud; within a cell as they came."""
    low, extent = points.min(), np.ptp(points)
    bits = ((points - low) / (extent or 1.0) * CELLS).astype(np.uint16)
    for shift, mask in ((8, 0x100F), (4, 0x10C3), (2, 0x1249)):  # two zeros between any two bits
        bits = (bits | (bits << shift)) & mask
    return np.argsort(bits[:, 0] | (bits[:, 1] << 1) | (bits[:, 2] << 2), kind="stable")


def validated(points: Float[np.ndarray, "n 3"], name: str) -> Float[np.ndarray, "n 3"]:
    """The cloud as contiguous float64, checked: at least one point, three columns, all finite."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2:
        raise checks.InputError(f"{name} must be a cloud of shape (n, 3); got shape {points.shape}")
    checks.require_vectors(name, points)
    if len(points) == 0:
        raise checks.InputError(f"{name} must hold at least one point; got an empty cloud")
    low, high = points.min(), points.max()
    if not (np.isfinite(low) and np.isfinite(high)):
        checks.require_finite(name, points)
    if max(-low, high) > LARGEST:
        raise checks.InputError(f"{name} must have coordinates within ±{LARGEST:g}; larger squared distances overflow")
    return points

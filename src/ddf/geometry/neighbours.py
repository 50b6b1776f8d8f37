"""Nearest neighbours between point clouds in float64: by Open3D's KD-tree, or by SciPy's where there is no Open3D.

Both give the same squared distances, to the last bit: SciPy tells distances that are not squared, whose square no
longer equals a threshold exactly, so they are computed anew.
"""

import importlib.util

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks

LARGEST = 1e150  # its square, 1e300, still fits float64


class Tree:
    """A KD-tree over a cloud: build once, search often."""

    def __init__(self, points: Float[np.ndarray, "n 3"]) -> None:
        self.points, self._cloud = points, None
        if importlib.util.find_spec("open3d") is None:
            from scipy import spatial  # takes long to import

            self._tree = spatial.cKDTree(points)
        else:
            from open3d import core

            self._cloud, self._tree = core.Tensor, core.nns.NearestNeighborSearch(core.Tensor(points))
            self._tree.knn_index()

    def search(
        self, queries: Float[np.ndarray, "m 3"], count: int
    ) -> tuple[Int[np.ndarray, "m {count}"], Float[np.ndarray, "m {count}"]]:
        """Indices of the `count` nearest points of the cloud, nearest first, and their squared distances."""
        if self._cloud is not None:
            index, dist_sq = (each.numpy() for each in self._tree.knn_search(self._cloud(queries), count))
            return index.view(np.int64), dist_sq
        index = self._tree.query(queries, list(range(1, count + 1)), workers=-1)[1]
        x, y, z = np.moveaxis(queries[:, None] - self.points[index], -1, 0)
        return index, x**2 + y**2 + z**2


class Neighbours(Tree):
    """A tree over a cloud, in float64; InputError of no points, not three columns, or a value that is not finite."""

    def __init__(self, points: Float[np.ndarray, "n 3"], name: str = "points") -> None:
        super().__init__(validated(points, name))

    def __len__(self) -> int:
        return len(self.points)

    def nearest(
        self, queries: Float[np.ndarray, "m 3"], name: str = "queries"
    ) -> tuple[Float[np.ndarray, " m"], Int[np.ndarray, " m"]]:
        """Squared distance to, and index of, the nearest point of the cloud for each query (ties: any of them)."""
        index, dist_sq = self.search(validated(queries, name), 1)
        return dist_sq[:, 0], index[:, 0]

    def dist_sq(
        self, queries: "Float[np.ndarray, 'm 3'] | Neighbours", name: str = "queries"
    ) -> Float[np.ndarray, " m"]:
        """Squared distance to the nearest point of the cloud for each query; another cloud is checked already."""
        points = queries.points if isinstance(queries, Neighbours) else validated(queries, name)
        return self.search(points, 1)[1][:, 0]

    def spacing(self) -> Float[np.ndarray, " n"]:
        """Distance, not squared, from each point of the cloud to the nearest other one; 0 where a place is taken twice.
        InputError where it is a single point.
        """
        if len(self) < 2:
            raise checks.InputError("the spacing of a cloud needs two points or more; got 1")
        return np.sqrt(self.search(self.points, 2)[1][:, 1])


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

"""Chamfer distance and F-score of 5,000 against 8,000 points: this package against what other libraries take for them.

Every way gives D_C and F(τ) of the same pair of clouds (points of a torus, the second with noise); the errors are the
largest relative difference of any squared distance and the differences of both scores from a sum over all pairs of
points in float64. Building the search trees is part of the time.
"""

from collections.abc import Callable

import numpy as np
import open3d as o3d
import torch
from scipy import spatial

from bench.lib import measuring, page
from ddf.geometry import neighbours
from ddf.metrics import cloud_scores

THREADS, REPEATS, MOST_SECONDS = 2, 41, 1.5
NUM_PRED, NUM_TRUTH, NOISE = 5000, 8000, 0.005
TAU_SQ = cloud_scores.TAU_SQ
Distances = tuple[np.ndarray, np.ndarray]


def torus(count: int, noise: float, seed: int) -> np.ndarray:
    """Points of a torus of the size of a shape in the benchmark frame, each moved by noise."""
    rng = np.random.default_rng(seed)
    along, around = rng.uniform(0, 2 * np.pi, (2, count))
    ring = 0.18 + 0.07 * np.cos(around)
    points = np.stack((ring * np.cos(along), 0.07 * np.sin(around), ring * np.sin(along)), axis=-1)
    return points + noise * rng.standard_normal((count, 3))


def ours(prediction: np.ndarray, truth: np.ndarray) -> Distances:
    """The search of the package, as `cloud_scores.compare_clouds` does it for its scores."""
    left, right = neighbours.Neighbours(prediction), neighbours.Neighbours(truth)
    return right.dist_sq(left), left.dist_sq(right)


def open3d_legacy(prediction: np.ndarray, truth: np.ndarray) -> Distances:
    """Open3D's own distance between two clouds, squared afterwards."""
    left, right = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)) for points in (prediction, truth))
    both = left.compute_point_cloud_distance(right), right.compute_point_cloud_distance(left)
    there, back = (np.square(np.asarray(distances)) for distances in both)
    return there, back


def scipy_tree(prediction: np.ndarray, truth: np.ndarray) -> Distances:
    """cKDTree of scipy, unsquared distances that are squared afterwards."""
    left, right = spatial.cKDTree(prediction), spatial.cKDTree(truth)
    there, back = right.query(prediction, workers=THREADS)[0], left.query(truth, workers=THREADS)[0]
    return np.square(there), np.square(back)


def torch_pairs(dtype: torch.dtype) -> Callable[[np.ndarray, np.ndarray], Distances]:
    """All pairs by torch.cdist; in float64 without its detour over a matrix product, which loses digits."""
    mode = "donot_use_mm_for_euclid_dist" if dtype == torch.float64 else "use_mm_for_euclid_dist_if_necessary"

    def distances(prediction: np.ndarray, truth: np.ndarray) -> Distances:
        left, right = (torch.from_numpy(points).to(dtype) for points in (prediction, truth))
        pairs = torch.cdist(left, right, compute_mode=mode)
        there, back = pairs.amin(dim=1), pairs.amin(dim=0)
        return there.double().square().numpy(), back.double().square().numpy()

    return distances


def all_pairs(prediction: np.ndarray, truth: np.ndarray) -> Distances:
    """The definition: squared differences of all pairs, float64."""
    pairs = spatial.distance.cdist(prediction, truth, "sqeuclidean")
    return pairs.min(axis=1), pairs.min(axis=0)


def open3d_metrics(prediction: np.ndarray, truth: np.ndarray) -> list[float]:
    """Open3D's own Chamfer distance (unsquared) and F-score (percent), in one call."""
    left, right = (
        o3d.t.geometry.PointCloud(o3d.core.Tensor(points.astype(np.float32))) for points in (prediction, truth)
    )
    kinds = (o3d.t.geometry.Metric.ChamferDistance, o3d.t.geometry.Metric.FScore)
    radius = o3d.t.geometry.MetricParameters(fscore_radius=[TAU_SQ**0.5])
    return left.compute_metrics(right, kinds, radius).numpy().tolist()


def scores(there: np.ndarray, back: np.ndarray) -> tuple[float, float]:
    """D_C and F(τ)."""
    return cloud_scores.chamfer_l2_sq(there, back), cloud_scores.f_score(there, back, TAU_SQ)


PICTURE = (page.View("chamfer_relative", "relative error of D_C"),)


def main() -> None:
    """Measure every way on one pair of clouds."""
    torch.set_num_threads(THREADS)
    prediction, truth = torus(NUM_PRED, NOISE, 1), torus(NUM_TRUTH, 0.0, 2)
    exact = all_pairs(prediction, truth)
    chamfer, f_score = scores(*exact)
    ways: dict[str, Callable[[np.ndarray, np.ndarray], Distances]] = {
        "ddf.geometry.neighbours": ours,
        "Open3D compute_point_cloud_distance": open3d_legacy,
        "scipy cKDTree": scipy_tree,
        "torch.cdist float32": torch_pairs(torch.float32),
        "torch.cdist float64": torch_pairs(torch.float64),
    }
    candidates: dict[str, Callable[[], object]] = {
        name: (lambda way=way: scores(*way(prediction, truth))) for name, way in ways.items()
    }
    candidates["ddf.metrics.cloud_scores.compare_clouds"] = lambda: cloud_scores.compare_clouds(
        prediction, truth, TAU_SQ
    )
    candidates["Open3D compute_metrics"] = lambda: open3d_metrics(prediction, truth)
    times = measuring.interleaved(candidates, REPEATS, MOST_SECONDS)
    size = {"num_pred": NUM_PRED, "num_truth": NUM_TRUTH}
    rows = []
    for name, seconds in times.items():
        if name in ways:
            found = ways[name](prediction, truth)
            gaps = [np.abs(d - e) / e for d, e in zip(found, exact, strict=True)]
            value, share = scores(*found)
            error = {"dist_sq_max_relative": float(max(gap.max() for gap in gaps))}
        elif name == "Open3D compute_metrics":
            length, percent = open3d_metrics(prediction, truth)
            truth_length = sum(float(np.sqrt(dist_sq).mean()) for dist_sq in exact)
            value, share, error = chamfer * length / truth_length, percent / 100, {}
        else:
            result = cloud_scores.compare_clouds(prediction, truth, TAU_SQ)
            value, share, error = result.chamfer_l2_sq, result.f_score_tau, {}
        error |= {"chamfer_relative": abs(value - chamfer) / chamfer, "f_score_difference": abs(share - f_score)}
        rows.append(measuring.row(name, size, seconds, error))
    measuring.write("evaluation", THREADS, rows)

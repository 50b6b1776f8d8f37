"""Chamfer distance and F-score of 5,000 against 8,000 points: this package against what other libraries take for them.

Every way gives D_C and F(τ) of the same pair of clouds (points of a torus, the second with noise); the errors are the
differences of both from a sum over all pairs of points in float64. Building the search trees is part of the time.
"""

from collections.abc import Callable

import numpy as np
import open3d as o3d
import torch
from scipy import spatial

from bench.lib import measuring
from ddf.metrics import cloud_scores

THREADS, REPEATS, MOST_SECONDS = 2, 41, 1.5
NUM_PRED, NUM_TRUTH, NOISE = 5000, 8000, 0.005
Scores = tuple[float, float]  # D_C and F(τ)


def torus(count: int, noise: float, seed: int) -> np.ndarray:
    """Points of a torus of the size of a shape in the benchmark frame, each moved by noise."""
    rng = np.random.default_rng(seed)
    along, around = rng.uniform(0, 2 * np.pi, (2, count))
    ring = 0.18 + 0.07 * np.cos(around)
    points = np.stack((ring * np.cos(along), 0.07 * np.sin(around), ring * np.sin(along)), axis=-1)
    return points + noise * rng.standard_normal((count, 3))


def scores(there: np.ndarray, back: np.ndarray) -> Scores:
    """Of squared distances from either cloud to the other."""
    return cloud_scores.chamfer_l2_sq(there, back), cloud_scores.f_score(there, back, cloud_scores.TAU_SQ)


def ours(prediction: np.ndarray, truth: np.ndarray) -> Scores:
    """What reports are made with."""
    found = cloud_scores.compare_clouds(prediction, truth, cloud_scores.TAU_SQ)
    return found.chamfer_l2_sq, found.f_score_tau


def open3d(prediction: np.ndarray, truth: np.ndarray) -> Scores:
    """Open3D's own distance between two clouds, squared afterwards."""
    left, right = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)) for points in (prediction, truth))
    both = left.compute_point_cloud_distance(right), right.compute_point_cloud_distance(left)
    return scores(*(np.square(np.asarray(distances)) for distances in both))


def scipy_tree(prediction: np.ndarray, truth: np.ndarray) -> Scores:
    """cKDTree of scipy, unsquared distances that are squared afterwards."""
    left, right = spatial.cKDTree(prediction), spatial.cKDTree(truth)
    there, back = right.query(prediction, workers=THREADS)[0], left.query(truth, workers=THREADS)[0]
    return scores(np.square(there), np.square(back))


def torch_pairs(prediction: np.ndarray, truth: np.ndarray) -> Scores:
    """All pairs by torch.cdist in float32."""
    left, right = (torch.from_numpy(points).float() for points in (prediction, truth))
    pairs = torch.cdist(left, right)
    return scores(*(pairs.amin(dim=way).double().square().numpy() for way in (1, 0)))


WAYS: dict[str, Callable[[np.ndarray, np.ndarray], Scores]] = {
    "ddf.metrics.cloud_scores.compare_clouds": ours,
    "Open3D compute_point_cloud_distance": open3d,
    "scipy cKDTree": scipy_tree,
    "torch.cdist float32": torch_pairs,
}


def main() -> measuring.Rows:
    """Every way on one pair of clouds."""
    prediction, truth = torus(NUM_PRED, NOISE, 1), torus(NUM_TRUTH, 0.0, 2)
    pairs = spatial.distance.cdist(prediction, truth, "sqeuclidean")
    chamfer, f_score = scores(pairs.min(axis=1), pairs.min(axis=0))
    candidates = {name: (lambda way=way: way(prediction, truth)) for name, way in WAYS.items()}
    for name, seconds in measuring.interleaved(candidates, REPEATS, MOST_SECONDS).items():
        value, share = candidates[name]()
        error = {"chamfer_relative": abs(value - chamfer) / chamfer, "f_score_difference": abs(share - f_score)}
        yield measuring.row(name, {"num_pred": NUM_PRED, "num_truth": NUM_TRUTH}, seconds, error)

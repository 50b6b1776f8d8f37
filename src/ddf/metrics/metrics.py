"""Errors of clouds, depths, visibilities, normals and cameras; each name carries its convention.

`dist_sq` is a squared distance to the nearest point of the other cloud. Clouds are compared in the benchmark frame
(0.57 x v1, see `transforms`); tau = 1e-4 is a threshold on the *squared* distance, a point counts as hit when dist_sq
<= tau. Tables print D_C x 1000 and F x 100. Sources: [DDF22] table `si3dr`; conventions of Pixel2Mesh's released
evaluation (docs/formats.md).
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from ddf.core import checks
from ddf.geometry import neighbours

TAU_SQ = 1e-4  # 0.01 benchmark units, 1.754 % of the v1 diagonal


@dataclass(frozen=True)
class Metric:
    """A score as tables have it.

    name: in si3dr.csv. score: the field of `CloudScores`. factor: of the tables. label: as the report prints it, None
    where it does not. digits: after the point. better: `min` or `max`.
    """

    name: str
    score: str
    factor: float
    label: str | None = None
    digits: int = 3
    better: Literal["min", "max"] = "max"


METRICS = {  # the one list: scores of every image, means of the long table and columns of the report follow it
    metric.name: metric
    for metric in (
        Metric("chamfer_l2_sq_x1000", "chamfer_l2_sq", 1000.0, "D<sub>C</sub> ↓", 3, "min"),
        Metric("f_score_tau_x100", "f_score_tau", 100.0, "F<sub>τ</sub> ↑", 2),
        Metric("f_score_2tau_x100", "f_score_2tau", 100.0, "F<sub>2τ</sub> ↑", 2),
        Metric("precision_tau_x100", "precision_tau", 100.0),
        Metric("recall_tau_x100", "recall_tau", 100.0),
        Metric("spacing_variation", "spacing_variation", 1.0, better="min"),
    )
}
PRINTED = {name: metric for name, metric in METRICS.items() if metric.label is not None}


@dataclass(frozen=True)
class CloudScores:
    """Scores of one predicted cloud; fractions in [0, 1], Chamfer in squared units of the clouds."""

    chamfer_l2_sq: float
    f_score_tau: float
    f_score_2tau: float
    precision_tau: float
    recall_tau: float
    num_pred: int
    num_truth: int


def chamfer_l2_sq(pred_to_truth_sq: Float[np.ndarray, " n"], truth_to_pred_sq: Float[np.ndarray, " m"]) -> float:
    """D_C = mean over truth + mean over prediction of the squared nearest distance: a sum, not halved."""
    return float(np.mean(truth_to_pred_sq, dtype=np.float64) + np.mean(pred_to_truth_sq, dtype=np.float64))


def hit_share(dist_sq: Float[np.ndarray, " n"], tau_sq: float) -> float:
    """Share of points with dist_sq <= tau_sq: precision from the prediction's distances, recall from the truth's."""
    return float(np.mean(dist_sq <= tau_sq))


def f_score(
    pred_to_truth_sq: Float[np.ndarray, " n"], truth_to_pred_sq: Float[np.ndarray, " m"], tau_sq: float = TAU_SQ
) -> float:
    """F = 2PR/(P + R) at dist_sq <= tau_sq; 0 when nothing is hit."""
    precision, recall = hit_share(pred_to_truth_sq, tau_sq), hit_share(truth_to_pred_sq, tau_sq)
    return 2.0 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0


def compare_clouds(
    prediction: Float[np.ndarray, "n 3"] | neighbours.Neighbours,
    truth: Float[np.ndarray, "m 3"] | neighbours.Neighbours,
    tau_sq: float = TAU_SQ,
) -> CloudScores:
    """All scores of one prediction against one truth, both in the benchmark frame.

    Args:
      prediction, truth: clouds, or `Neighbours` of clouds that are used again.
      tau_sq: threshold on squared distance; the second F-score uses 2 tau_sq.
    Raises:
      InputError: a cloud is empty or not finite, or tau_sq is not a positive number.
    """
    if not (np.isfinite(tau_sq) and tau_sq > 0):
        raise checks.InputError(f"tau_sq must be a positive squared distance; got {tau_sq}")
    if not isinstance(prediction, neighbours.Neighbours):
        prediction = neighbours.Neighbours(prediction, "prediction")
    if not isinstance(truth, neighbours.Neighbours):
        truth = neighbours.Neighbours(truth, "truth")
    to_truth, to_prediction = truth.dist_sq(prediction), prediction.dist_sq(truth)
    return CloudScores(
        chamfer_l2_sq=chamfer_l2_sq(to_truth, to_prediction),
        f_score_tau=f_score(to_truth, to_prediction, tau_sq),
        f_score_2tau=f_score(to_truth, to_prediction, 2 * tau_sq),
        precision_tau=hit_share(to_truth, tau_sq),
        recall_tau=hit_share(to_prediction, tau_sq),
        num_pred=len(prediction),
        num_truth=len(truth),
    )


def spacing_variation(cloud: neighbours.Neighbours) -> float:
    """How unevenly a cloud lies: standard deviation over mean of the distances to the nearest other point.

    Without unit, of any scale and, for one way of drawing, of any number of points: 0 for a lattice, sqrt(4/pi - 1) =
    0.52 for independent points spread evenly over a surface, more where they crowd (derived here: those distances are
    Rayleigh's). NaN for a single point, or when every place is taken twice.
    """
    if len(cloud) < 2:
        return float("nan")
    spacing = cloud.spacing()
    return float(spacing.std() / spacing.mean()) if spacing.any() else float("nan")


def depth_l1(
    depth: Float[np.ndarray, " n"], depth_truth: Float[np.ndarray, " n"], visible_truth: Bool[np.ndarray, " n"]
) -> float:
    """Mean |depth - truth| over the rays that truly hit; NaN when none does. Scene units along the ray."""
    return float(np.mean(np.abs(depth[visible_truth] - depth_truth[visible_truth]))) if visible_truth.any() else np.nan


def visibility_bce(visibility: Float[np.ndarray, " n"], visible_truth: Bool[np.ndarray, " n"]) -> float:
    """Mean binary cross-entropy in nats; probabilities are clipped to 1e-7, float32's distance from 1."""
    probability = np.clip(np.asarray(visibility, dtype=np.float64), 1e-7, 1 - 1e-7)
    return float(-np.mean(np.where(visible_truth, np.log(probability), np.log1p(-probability))))


def normal_angle_deg(
    normals: Float[np.ndarray, "n 3"], normals_truth: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, " n"]:
    """Angle between unit normals in degrees, exact near 0 and 180 (from chord lengths, not arccos)."""
    opposite = np.linalg.norm(normals - normals_truth, axis=-1)
    adjacent = np.linalg.norm(normals + normals_truth, axis=-1)
    return np.degrees(2.0 * np.arctan2(opposite, adjacent))


def angle_difference_deg(
    angle_rad: Float[np.ndarray, " n"], truth_rad: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Smallest |difference| of two azimuths in degrees, in [0, 180]: they wrap round."""
    difference = np.asarray(angle_rad, dtype=np.float64) - np.asarray(truth_rad, dtype=np.float64)
    return np.degrees(np.abs((difference + np.pi) % (2 * np.pi) - np.pi))

"""How near two clouds are; each name carries its convention.

`dist_sq` is a squared distance to the nearest point of the other cloud. Clouds are compared in the benchmark frame
(0.57 x v1, see `transforms`); tau = 1e-4 is a threshold on the *squared* distance, a point counts as hit when dist_sq
<= tau. Tables print D_C x 1000 and F x 100. Sources: [DDF22] table `si3dr`; conventions of Pixel2Mesh's released
evaluation (docs/formats.md).

Two meshes are compared by points drawn on both: Chamfer distance, F-scores and normal consistency.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.data import mesh_topology
from ddf.data.samples.draws import Surface
from ddf.geometry import mesh_io, neighbours
from ddf.geometry.mesh_io import Mesh

TAU_SQ = 1e-4  # 0.01 benchmark units, 1.754 % of the v1 diagonal


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


@dataclass(frozen=True)
class Pair:
    """Two clouds that are compared, and squared distances from each one's points to the other cloud."""

    prediction: neighbours.Neighbours
    truth: neighbours.Neighbours
    to_truth: Float[np.ndarray, " n"]
    to_prediction: Float[np.ndarray, " m"]
    tau_sq: float

    def f_score(self, factor: float) -> float:
        """At a multiple of the threshold."""
        return f_score(self.to_truth, self.to_prediction, factor * self.tau_sq)


@dataclass(frozen=True)
class Metric:
    """A score of a cloud.

    score: its name. compute: from a pair. unit: of the score. factor: by which tables have it. label: as the report
    prints it, None where it does not. digits: after the point. better: `min` or `max`.
    """

    score: str
    compute: Callable[[Pair], float]
    unit: str
    factor: float = 1.0
    label: str | None = None
    digits: int = 3
    better: Literal["min", "max"] = "max"

    @property
    def name(self) -> str:
        """In si3dr.csv."""
        return self.score if self.factor == 1 else f"{self.score}_x{self.factor:g}"


METRICS = {  # the one list: `ddf compare`, scores of every image, the long table and the columns of reports follow it
    metric.name: metric
    for metric in (
        Metric(
            "chamfer_l2_sq",
            lambda pair: chamfer_l2_sq(pair.to_truth, pair.to_prediction),
            "squared units of the clouds",
            1000.0,
            "D<sub>C</sub> ↓",
            better="min",
        ),
        Metric("f_score_tau", lambda pair: pair.f_score(1.0), "share", 100.0, "F<sub>τ</sub> ↑", 2),
        Metric("f_score_2tau", lambda pair: pair.f_score(2.0), "share", 100.0, "F<sub>2τ</sub> ↑", 2),
        Metric("precision_tau", lambda pair: hit_share(pair.to_truth, pair.tau_sq), "share", 100.0, digits=1),
        Metric("recall_tau", lambda pair: hit_share(pair.to_prediction, pair.tau_sq), "share", 100.0, digits=1),
        Metric("spacing_variation", lambda pair: spacing_variation(pair.prediction), "share of the mean", better="min"),
    )
}
PRINTED = {name: metric for name, metric in METRICS.items() if metric.label is not None}


@dataclass(frozen=True)
class CloudScores:
    """Scores of one predicted cloud by the names of `METRICS`, which are attributes too, and the numbers of points."""

    scores: dict[str, float]
    num_pred: int
    num_truth: int

    def __getattr__(self, name: str) -> float:
        if name.startswith("_") or name not in self.scores:
            raise AttributeError(name)
        return self.scores[name]

    def to_dict(self) -> dict[str, Any]:
        """All by name."""
        return {**self.scores, "num_pred": self.num_pred, "num_truth": self.num_truth}


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
    pair = Pair(prediction, truth, truth.dist_sq(prediction), prediction.dist_sq(truth), tau_sq)
    scores = {metric.score: metric.compute(pair) for metric in METRICS.values()}
    return CloudScores(scores, len(prediction), len(truth))


@dataclass(frozen=True)
class SurfaceScores:
    """clouds: scores of the points drawn. chamfer_l1: mean of both means of distances, not squared.

    normal_consistency: mean of both means of |n . n'| with the nearest point's normal; 1 is best. watertight: every
    edge has two triangles.
    """

    clouds: CloudScores
    chamfer_l1: float
    normal_consistency: float
    watertight: bool


def compare_meshes(mesh: Mesh, truth: Mesh, points: int = 10_000) -> SurfaceScores:
    """Scores of a mesh against the true one, by points drawn by area on both; both in one frame and unit."""
    random = np.random.default_rng(0)
    drawn, normals = zip(*(_draw(each, points, random) for each in (mesh, truth)), strict=True)
    distances, agreement = [], []
    for own, other in ((0, 1), (1, 0)):
        dist_sq, index = neighbours.Neighbours(drawn[other]).nearest(drawn[own])
        distances.append(np.sqrt(dist_sq).mean())
        agreement.append(np.abs((normals[own] * normals[other][index]).sum(axis=1)).mean())
    return SurfaceScores(
        compare_clouds(drawn[0], drawn[1]),
        float(np.mean(distances)),
        float(np.mean(agreement)),
        mesh_topology.is_watertight(mesh),
    )


def _draw(mesh: Mesh, count: int, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points drawn by area, and the normals of their triangles."""
    points, face = Surface.of(mesh).draw(count, random)
    return points, mesh_io.face_normals(mesh)[0][face]

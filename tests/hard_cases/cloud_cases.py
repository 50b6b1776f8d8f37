"""Hard clouds: scored (one point, repeated, unequal, empty, far away) and drawn (cancelling, invisible, on sheets)."""

import dataclasses
import math

import numpy as np
import torch
from torch import Tensor

from ddf.fields import cloud_projection, pddf, udf
from ddf.metrics import cloud_scores

from . import case
from .field_cases import SATURATED, constant_field

METRICS = case.Group("metrics")
CLOUDS = case.Group("clouds")
PAPER = cloud_projection.CloudConfig(64, 3, 0.1, 0.0, (), None, 0.05, 0.01, 4096)


def _array(points: object, dtype: torch.dtype) -> np.ndarray:
    return torch.tensor(points, dtype=torch.float64).to(dtype).numpy()


def _scores(prediction: object, truth: object, dtype: torch.dtype, expected: tuple[float, ...]) -> case.Outcome:
    """(D_C, F, F at 2τ, precision, recall) at τ = 1e-4, within 2 ε of the largest."""
    found = cloud_scores.compare_clouds(_array(prediction, dtype), _array(truth, dtype), 1e-4)
    values = (found.chamfer_l2_sq, found.f_score_tau, found.f_score_2tau, found.precision_tau, found.recall_tau)
    return case.close(values, expected, 2 * case.step(dtype) * max(expected))


@METRICS.case(
    "one point against one point",
    "(0, 0, 0) against (0.003, 0.004, 0)",
    "D_C = 2 x 25e-6, F = 1 (25e-6 <= τ = 1e-4)",
)
def _one_point(dtype: torch.dtype) -> case.Outcome:
    return _scores([[0.0, 0, 0]], [[0.003, 0.004, 0]], dtype, (5e-5, 1, 1, 1, 1))


@METRICS.case(
    "repeated points",
    "one point five times against itself and a point 1 away, seven times each",
    "D_C = 1/2, precision 1, recall 1/2, F = 2/3: repeated points count each",
)
def _repeated(dtype: torch.dtype) -> case.Outcome:
    truth = [[0.25, 0, 0]] * 7 + [[1.25, 0, 0]] * 7
    return _scores([[0.25, 0, 0]] * 5, truth, dtype, (0.5, 2 / 3, 2 / 3, 1, 0.5))


@METRICS.case(
    "unequal clouds",
    "1 point against 4 on a line, 0, 1, 2 and 3 away",
    "D_C = 14/4, precision 1, recall 1/4, F = 0.4; exchanged: precision 1/4, recall 1",
)
def _unequal(dtype: torch.dtype) -> case.Outcome:
    line = [[float(i), 0.0, 0.0] for i in range(4)]
    return case.worst(
        _scores(line[:1], line, dtype, (3.5, 0.4, 0.4, 1, 0.25)),
        _scores(line, line[:1], dtype, (3.5, 0.4, 0.4, 0.25, 1)),
    )


@METRICS.case(
    "nothing in common",
    "two clouds 2 apart; a cloud and itself backwards",
    "D_C = 8 and F = 0, not NaN; D_C exactly 0 and F = 1",
)
def _disjoint(dtype: torch.dtype) -> case.Outcome:
    here, there = [[0.0, 0, 0]] * 3, [[0.0, 2, 0]] * 4
    grid = [[0.1 * i, 0.2 * i, -0.3 * i] for i in range(9)]
    return case.worst(_scores(here, there, dtype, (8, 0, 0, 0, 0)), _scores(grid, grid[::-1], dtype, (0, 1, 1, 1, 1)))


@METRICS.case(
    "a distance that equals the threshold",
    "points 2^-7 apart, τ = 2^-14, and the next float64 below it",
    "a hit at <= τ, none below",
)
def _threshold(dtype: torch.dtype) -> case.Outcome:
    clouds = _array([[0.5, 0, 0]], dtype), _array([[0.5 + 2.0**-7, 0, 0]], dtype)
    found = [
        cloud_scores.compare_clouds(*clouds, tau).f_score_tau for tau in (2.0**-14, float(np.nextafter(2.0**-14, 0)))
    ]
    return case.exact(found, [1.0, 0.0])


@METRICS.case(
    "clouds 1e6 from their origin",
    "points 1/4 apart around (1e6, -1e6, 5e5)",
    "D_C = 2/16 exactly: squared distances are formed in float64",
)
def _far_clouds(dtype: torch.dtype) -> case.Outcome:
    here = np.array([[1e6, -1e6, 5e5], [1e6, -1e6, 5e5 + 8]])
    found = cloud_scores.compare_clouds(_array(here, dtype), _array(here + 0.25 * np.eye(3)[0], dtype), 1e-4)
    return case.exact(found.chamfer_l2_sq, 0.125)


@METRICS.case(
    "clouds that cannot be scored",
    "no points, NaN, inf or 1e200 (float64) on either side; thresholds of 0, -1, NaN and inf",
    "refused, naming the cloud and the rule",
)
def _unusable(dtype: torch.dtype) -> case.Outcome:
    good, found = np.zeros((2, 3)), []
    faults = [([[0.0, math.nan, 0]], "be finite; got nan"), ([[0.0, 0, math.inf]], "be finite; got inf")]
    faults += [([[1e200, 0, 0]], r"have coordinates within ±1e\+150")] if dtype == torch.float64 else []
    for points, rule in [(np.zeros((0, 3)).tolist(), "hold at least one point; got an empty cloud"), *faults]:
        bad = _array(points, dtype).reshape(-1, 3)
        found.append(case.refused(lambda b=bad: cloud_scores.compare_clouds(b, good), "prediction must " + rule))
        found.append(case.refused(lambda b=bad: cloud_scores.compare_clouds(good, b), "truth must " + rule))
    for tau in (0.0, -1.0, math.nan, math.inf):
        told = "tau_sq must be a positive squared distance"
        found.append(case.refused(lambda t=tau: cloud_scores.compare_clouds(good, good, t), told))
    return case.worst(*found, found[0])


class TwoSheets(pddf.PDDF):
    """The exact field of the planes x = ±1/2, seen from between them; all visible."""

    def __init__(self) -> None:
        super().__init__(pddf.PDDFConfig((4,), 1.0, 1.0, "relu", 1.0))

    def forward(self, positions: Tensor, directions: Tensor, modulations: list[Tensor] | None = None) -> Tensor:
        """Depth (±1/2 - p_x)/v_x, the sign that of v_x; nothing is modulated."""
        del modulations
        x, v = positions[..., 0], directions[..., 0]
        depth = (torch.where(v >= 0, 0.5, -0.5).to(x) - x) / torch.where(v == 0, torch.finfo(v.dtype).eps, v)
        return torch.stack((depth, depth, torch.ones_like(depth), torch.full_like(depth, 20.0)), dim=-1)


def _cancelled(visibility: float, far: float, dtype: torch.dtype) -> Tensor:
    """v̂* of the candidates ±x at depth 1/2, the second of them perhaps less visible, and of y, visible and `far`."""
    candidates = torch.tensor([[[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0]]], dtype=dtype)
    seen, depth = torch.tensor([[1.0, visibility, 1.0]], dtype=dtype), torch.tensor([[0.5, 0.5, far]], dtype=dtype)
    return udf.closest_directions(candidates, seen, depth, PAPER.temperature, PAPER.inverse_depth)


@CLOUDS.case(
    "candidates that cancel",
    "±x at depth 1/2 and y at 2: the weighted mean is 1e-13 long, along y; ±x with visibilities 1 and 0.999 (mean 0.02 "
    "along x); y at 0.545 instead (mean 0.02 along y)",
    "the heaviest candidate, exactly, never what rounding or a far surface leaves of the mean: ±x, x, ±x",
)
def _cancelling(dtype: torch.dtype) -> case.Outcome:
    x = torch.tensor([[1.0, 0.0, 0.0]])
    return case.every(
        case.exact(_cancelled(1.0, 2.0, dtype).abs(), x),
        case.exact(_cancelled(0.999, 2.0, dtype), x),
        case.exact(_cancelled(1.0, 0.545, dtype).abs(), x),
    )


@CLOUDS.case(
    "candidates that nearly cancel",
    "±x with visibilities 1 and 0.99, y 1e6 away: the mean is 0.19 long, above the limit of 0.05",
    "x within ε: the mean, normalised",
)
def _nearly_cancelling(dtype: torch.dtype) -> case.Outcome:
    return case.close(_cancelled(0.99, 1e6, dtype), [[1.0, 0.0, 0.0]], case.step(dtype))


@CLOUDS.case(
    "points half-way between two sheets",
    "200 points of the plane x = 0 between the planes x = ±1/2, 64 candidates each, whose mean nearly cancels",
    "unit directions and points on a sheet: |x| = 1/2 within 4 ε of the way there",
)
def _between_sheets(dtype: torch.dtype) -> case.Outcome:
    generator = torch.Generator().manual_seed(0)
    start = torch.rand(200, 3, generator=generator, dtype=dtype) - 0.5
    start[:, 0] = 0.0
    found = cloud_projection.project(TwoSheets(), None, start, PAPER, generator).points
    way = (found - start).norm(dim=-1).double()
    return case.close(found[:, 0].abs(), torch.full((200,), 0.5), 4 * case.step(dtype) * (1 + way))


@CLOUDS.case(
    "all candidates invisible",
    "ξ = 0 for the candidates x and y, 0.3 and 0.6 away",
    "equal weights: (1, 1, 0)/sqrt(2)",
)
def _invisible(dtype: torch.dtype) -> case.Outcome:
    candidates = torch.tensor([[[1.0, 0, 0], [0, 1.0, 0]]], dtype=dtype)
    depth = torch.tensor([[0.3, 0.6]], dtype=dtype)
    found = udf.closest_directions(candidates, torch.zeros_like(depth), depth, PAPER.temperature, PAPER.inverse_depth)
    return case.close(found, [[0.5**0.5, 0.5**0.5, 0.0]], 2 * case.step(dtype))


@CLOUDS.case(
    "a field that sees nothing",
    "logits of -1e4 everywhere, depth 0.3; a cloud of 20 points, 3 cycles",
    "20 finite points, ξ exactly 0",
)
def _sees_nothing(dtype: torch.dtype) -> case.Outcome:
    field = constant_field((0.3, 0.3, 9, -SATURATED), dtype)
    cycles = cloud_projection.sample(field, None, 20, PAPER, torch.Generator().manual_seed(0))
    (points,) = cloud_projection.select(cycles, [20], PAPER)
    return case.every(
        case.true("20 finite points", torch.isfinite(points).all() and points.shape == (20, 3)),
        case.exact(cycles[-1].visibility, torch.zeros(22)),
    )


@CLOUDS.case(
    "d = 0 at tiny temperatures",
    "candidates x at depth 0 and y at 1e-3, temperature 1e-4, ε_s = 1e-6: scores of 1e10",
    "x exactly, no overflow",
)
def _on_surface(dtype: torch.dtype) -> case.Outcome:
    candidates = torch.tensor([[[1.0, 0, 0], [0, 1.0, 0]]], dtype=dtype)
    depth = torch.tensor([[0.0, 1e-3]], dtype=dtype)
    config = dataclasses.replace(PAPER, temperature=1e-4, inverse_depth=1e-6)
    found = udf.closest_directions(candidates, torch.ones_like(depth), depth, config.temperature, config.inverse_depth)
    return case.exact(found, [[1.0, 0.0, 0.0]])


@CLOUDS.case(
    "starts that are on the surface",
    "points of the sheet x = 1/2, projected again with 64 candidates",
    "|x| = 1/2: they stay on it, or cross to the other sheet",
)
def _again(dtype: torch.dtype) -> case.Outcome:
    generator = torch.Generator().manual_seed(1)
    start = torch.rand(50, 3, generator=generator, dtype=dtype) - 0.5
    start[:, 0] = 0.5
    found = cloud_projection.project(TwoSheets(), None, start, PAPER, generator).points
    way = (found - start).norm(dim=-1).double()
    return case.close(found[:, 0].abs(), torch.full((50,), 0.5), 4 * case.step(dtype) * (1 + way))


@CLOUDS.case(
    "clouds of one point and of one place",
    "the more visible of 2 points; a farthest-point order of 5 equal points",
    "that point; finite indices",
)
def _one_place(dtype: torch.dtype) -> case.Outcome:
    points = torch.tensor([[0.1, 0, 0], [0.2, 0, 0]], dtype=dtype)
    seen = torch.tensor([0.2, 0.9], dtype=dtype)
    (kept,) = cloud_projection.select([cloud_projection.ProjectedPoints(points, seen, seen)], [1], PAPER)
    order = cloud_projection.farthest_point_order(torch.ones(5, 3, dtype=dtype), 5)
    return case.every(case.exact(kept, points[1:]), case.exact(order, [0] * 5))

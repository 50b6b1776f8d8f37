"""Hard clouds to score: one point, repeated, unequal, apart, at the threshold, far away, refused."""

import math

import numpy as np
import pytest
import torch
from _hard import FAR, assert_exact, assert_refused, assert_within, step

from ddf.metrics import cloud_scores

LINE = [[float(i), 0.0, 0.0] for i in range(4)]
GRID = [[0.1 * i, 0.2 * i, -0.3 * i] for i in range(9)]
POINT = [[0.25, 0, 0]]


def _array(points, dtype):
    return torch.tensor(points, dtype=torch.float64).to(dtype).reshape(-1, 3).numpy()


@pytest.mark.parametrize(
    ("prediction", "truth", "expected"),
    [
        pytest.param([[0.0, 0, 0]], [[0.003, 0.004, 0]], (5e-5, 1, 1, 1, 1), id="one point against one"),
        pytest.param(POINT * 5, POINT * 7 + [[1.25, 0, 0]] * 7, (0.5, 2 / 3, 2 / 3, 1, 0.5), id="repeated points"),
        pytest.param(LINE[:1], LINE, (3.5, 0.4, 0.4, 1, 0.25), id="one against four"),
        pytest.param(LINE, LINE[:1], (3.5, 0.4, 0.4, 0.25, 1), id="four against one"),
        pytest.param([[0.0, 0, 0]] * 3, [[0.0, 2, 0]] * 4, (8, 0, 0, 0, 0), id="nothing in common"),
        pytest.param(GRID, GRID[::-1], (0, 1, 1, 1, 1), id="itself backwards"),
    ],
)
def test_scores_of_few_points(prediction, truth, expected, dtype):
    """(D_C, F, F at 2τ, precision, recall) at τ = 1e-4, within 2 ε of the largest."""
    found = cloud_scores.compare_clouds(_array(prediction, dtype), _array(truth, dtype), 1e-4)
    values = (found.chamfer_l2_sq, found.f_score_tau, found.f_score_2tau, found.precision_tau, found.recall_tau)
    assert_within(values, expected, 2 * step(dtype) * max(expected))


@pytest.mark.parametrize(("tau", "hit"), [(2.0**-14, 1.0), (float(np.nextafter(2.0**-14, 0)), 0.0)])
def test_a_distance_that_equals_the_threshold_is_a_hit(tau, hit, dtype):
    clouds = _array([[0.5, 0, 0]], dtype), _array([[0.5 + 2.0**-7, 0, 0]], dtype)
    assert cloud_scores.compare_clouds(*clouds, tau).f_score_tau == hit


def test_clouds_1e6_from_their_origin_are_scored_in_float64(dtype):
    here = np.stack((FAR, FAR + np.array([0.0, 0.0, 8.0])))
    there = here + np.array([0.25, 0.0, 0.0])
    found = cloud_scores.compare_clouds(_array(here.tolist(), dtype), _array(there.tolist(), dtype))
    assert_exact(found.chamfer_l2_sq, 0.125)


@pytest.mark.parametrize(
    ("points", "rule"),
    [
        ([], "hold at least one point; got an empty cloud"),
        ([[0.0, math.nan, 0]], "be finite; got nan"),
        ([[0.0, 0, math.inf]], "be finite; got inf"),
        ([[1e200, 0, 0]], r"(have coordinates within ±1e\+150|be finite; got inf)"),
    ],
)
def test_clouds_that_cannot_be_scored_are_refused_on_either_side(points, rule, dtype):
    good, bad = np.zeros((2, 3)), _array(points, dtype)
    assert_refused(lambda: cloud_scores.compare_clouds(bad, good), "prediction must " + rule)
    assert_refused(lambda: cloud_scores.compare_clouds(good, bad), "truth must " + rule)


@pytest.mark.parametrize("tau", [0.0, -1.0, math.nan, math.inf])
def test_thresholds_that_are_no_squared_distance_are_refused(tau):
    good = np.zeros((2, 3))
    assert_refused(lambda: cloud_scores.compare_clouds(good, good, tau), "tau_sq must be a positive squared distance")

"""Cloud metrics against a brute-force float64 computation, and in closed form; scores of surfaces."""

import math

import numpy as np
import pytest
import torch
from _hard import assert_refused, assert_within, step
from _shapes import icosphere

from ddf.core import checks
from ddf.geometry import neighbours
from ddf.geometry.mesh_io import Mesh
from ddf.metrics import cloud_scores


def _brute_dist_sq(queries, points):
    difference = np.asarray(queries, np.float64)[:, None] - np.asarray(points, np.float64)[None]
    return (difference**2).sum(-1).min(1)


def _brute_scores(prediction, truth, tau_sq):
    to_truth, to_prediction = _brute_dist_sq(prediction, truth), _brute_dist_sq(truth, prediction)
    scores = [to_truth.mean() + to_prediction.mean()]
    for threshold in (tau_sq, 2 * tau_sq):
        precision, recall = (to_truth <= threshold).mean(), (to_prediction <= threshold).mean()
        scores.append(2 * precision * recall / (precision + recall) if precision + recall else 0.0)
    return [*scores, (to_truth <= tau_sq).mean(), (to_prediction <= tau_sq).mean()]


def _values(scores):
    return [scores.chamfer_l2_sq, scores.f_score_tau, scores.f_score_2tau, scores.precision_tau, scores.recall_tau]


def _cloud(seed, count, spread=0.3, offset=0.0):
    return np.random.default_rng(seed).normal(size=(count, 3)) * spread + offset


_PAIRS = {
    "unequal counts": (_cloud(0, 300), _cloud(1, 1100)),
    "close pair": (_cloud(0, 500, 0.01), _cloud(0, 500, 0.01) + 1e-3),
    "duplicates": (np.repeat(_cloud(2, 40, 0.02), 5, axis=0), np.concatenate([_cloud(3, 90, 0.02)] * 3)),
    "all the same point": (np.full((64, 3), 0.25), np.full((700, 3), 0.255)),
    "float32 far from the origin": (np.float32(_cloud(6, 400, 0.02, 7e3)), np.float32(_cloud(7, 300, 0.02, 7e3))),
    "far from the origin": (_cloud(6, 400, 0.01, 1e5), _cloud(7, 300, 0.01, 1e5)),
    "flat and collinear": (_cloud(8, 200) * [1, 0, 0], _cloud(9, 150) * [1, 0, 0]),
}


@pytest.mark.parametrize("name", _PAIRS)
@pytest.mark.parametrize("tau_sq", [1e-4, 0.02])
def test_scores_equal_brute_force(name, tau_sq):
    prediction, truth = _PAIRS[name]
    scores = cloud_scores.compare_clouds(prediction, truth, tau_sq)
    np.testing.assert_allclose(_values(scores), _brute_scores(prediction, truth, tau_sq), rtol=1e-6, atol=0)
    assert (scores.num_pred, scores.num_truth) == (len(prediction), len(truth))


def test_spacing_is_the_distance_to_the_nearest_other_point():
    points = np.concatenate([_cloud(1, 250), _cloud(1, 3)])  # three places are taken twice
    dist_sq = ((points[:, None] - points[None]) ** 2).sum(-1)
    np.fill_diagonal(dist_sq, np.inf)
    np.testing.assert_allclose(neighbours.Neighbours(points).spacing() ** 2, dist_sq.min(1), rtol=1e-12)
    with pytest.raises(checks.InputError, match="two points or more; got 1"):
        neighbours.Neighbours(points[:1]).spacing()


@pytest.mark.parametrize("extent", [0.0, 5e-324, 1e-308, 1e150])
def test_clouds_of_any_extent_are_searched(extent):
    points = np.array([[0.0, 0.0, 0.0], [extent, 0.0, extent], [0.0, extent, extent]])
    dist_sq, index = neighbours.Neighbours(points).nearest(points)
    np.testing.assert_array_equal(dist_sq, 0.0)
    if extent == 1e150:  # squares of the others are 0
        np.testing.assert_array_equal(index, [0, 1, 2])


def test_variation_of_spacing_of_a_lattice_of_even_and_of_crowded_points():
    generator = np.random.default_rng(0)
    lattice = np.stack(np.meshgrid(np.arange(70.0), np.arange(70.0), [0.0]), axis=-1).reshape(-1, 3)
    even = generator.uniform(size=(40_000, 3)) * [1, 1, 0]
    crowded = even**2  # three quarters of the area hold half of the points
    variation = [cloud_scores.spacing_variation(neighbours.Neighbours(points)) for points in (lattice, even, crowded)]
    assert variation[0] == pytest.approx(0.0, abs=1e-12)
    assert variation[1] == pytest.approx(np.sqrt(4 / np.pi - 1), abs=0.01)  # its error at this count is 0.003
    assert variation[2] > 0.7
    scaled = cloud_scores.spacing_variation(neighbours.Neighbours(7.0 * even + 1.0))
    assert scaled == pytest.approx(variation[1], rel=1e-6)
    for nowhere in (even[:1], np.repeat(even[:5], 2, axis=0)):
        assert np.isnan(cloud_scores.spacing_variation(neighbours.Neighbours(nowhere)))


def test_shifted_grid_in_closed_form():
    axis = np.arange(8) * 0.125  # binary fractions: every distance is exact
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    shift = 0.03125
    scores = cloud_scores.compare_clouds(grid + shift * np.eye(3)[0], grid, tau_sq=shift**2)
    assert scores.chamfer_l2_sq == 2 * shift**2  # the sum of both directions, not half of it
    assert scores.f_score_tau == scores.precision_tau == scores.recall_tau == 1.0  # <=, not <
    below = cloud_scores.compare_clouds(grid + shift * np.eye(3)[0], grid, tau_sq=np.nextafter(shift**2, 0))
    assert below.f_score_tau == 0.0 and below.f_score_2tau == 1.0


def test_concentric_spheres_lie_their_difference_apart():
    found = cloud_scores.compare_meshes(icosphere(4, 1.0), icosphere(4, 0.9), points=4000)
    assert found.chamfer_l1 == pytest.approx(0.1, abs=0.01)
    assert found.clouds.chamfer_l2_sq == pytest.approx(2 * 0.1**2, rel=0.15)
    assert found.normal_consistency > 0.99 and found.watertight


def test_crossed_squares_disagree_in_their_normals():
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    found = cloud_scores.compare_meshes(Mesh(corners, faces), Mesh(corners[:, [0, 2, 1]], faces), points=500)
    assert found.normal_consistency < 1e-9 and not found.watertight


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
    assert_within(_values(found), expected, 2 * step(dtype) * max(expected))


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

"""ICP with a scale, wrong poses and the rows of the bench of completion."""

import json
from types import SimpleNamespace
from typing import Any

import _shapes
import numpy as np
import pytest

from bench.lib import measuring
from bench.reconstruction import complete
from ddf.data.synthetic import render
from ddf.fit import completed_surface
from ddf.geometry import neighbours, transforms


def test_icp_lays_a_cloud_over_hits_of_it_that_were_turned_moved_and_scaled():
    points = np.random.default_rng(0).normal(size=(20_000, 3))
    cloud = points / np.linalg.norm(points, axis=1, keepdims=True) * [1.0, 0.6, 0.3]
    turn = complete.off(transforms.Similarity(), np.random.default_rng(1)).rotation
    left, _, right = np.linalg.svd(np.eye(3) + (turn - turn.T) / 20)
    moved = transforms.Similarity(1.08, left @ right, np.array([0.03, -0.02, 0.05]))
    hits = moved.apply(cloud[np.random.default_rng(2).permutation(len(cloud))[:400]])
    placed, miss = complete.align(cloud, hits)
    before = np.linalg.norm(cloud - moved.apply(cloud), axis=1).mean()
    assert np.linalg.norm(placed - moved.apply(cloud), axis=1).mean() < 0.5 * before
    assert miss < 0.02


def test_a_wrong_pose_is_as_wrong_as_it_says():
    place = transforms.Similarity(0.4, np.eye(3), np.array([1.0, 0, 0]))
    wrong = complete.off(place, np.random.default_rng(3))
    angle = np.degrees(np.arccos((np.trace(wrong.rotation) - 1) / 2))
    assert angle == pytest.approx(complete.TURN_DEG)
    assert abs(wrong.scale / 0.4 - 1) == pytest.approx(complete.GROWTH)
    assert np.linalg.norm(wrong.translation - place.translation) == pytest.approx(0.4 * complete.SHIFT)


@pytest.fixture(scope="module")
def ball() -> complete.Case:
    """A sphere that both cameras see."""
    mesh = _shapes.icosphere(4, 0.4)
    parts: Any = SimpleNamespace(vertices=mesh.vertices, triangles=mesh.faces)
    views = [render.View(azimuth, 20.0, 1.5) for azimuth in (0.0, 90.0)]
    cloud = neighbours.Neighbours(complete.K * mesh.vertices)
    return complete.Case(parts, cloud, transforms.Similarity(0.4, np.eye(3), np.zeros(3)), views)


def test_nearest_is_the_one_that_lies_on_the_hits(ball: complete.Case) -> None:
    points = np.random.default_rng(0).normal(size=(2000, 3))
    sphere = 0.4 * points / np.linalg.norm(points, axis=1, keepdims=True)
    for known in ([sphere, sphere * [1, 0.3, 0.1]], [sphere * [1, 0.3, 0.1], sphere]):
        assert complete.nearest(ball, known)["chamfer_l2_sq_x1000"] < 1


def test_a_ray_without_an_interval_counts_as_missed(ball: complete.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    def along(_field: Any, _found: Any, positions: np.ndarray, _directions: np.ndarray, _share: float):
        low, high = np.zeros(len(positions)), np.full(len(positions), 9.0)
        low[::2] = high[::2] = np.nan
        return low, high

    monkeypatch.setattr(completed_surface, "along_rays", along)
    solver: Any = SimpleNamespace(decoder=SimpleNamespace(field=None))
    told = complete.Solver.coverage(solver, ball, ball, np.random.default_rng(0))  # type: ignore
    assert told["coverage_50"] == told["coverage_90"] == 50
    assert told["width_90"] == pytest.approx(9 / 0.4)


def test_rows_have_the_paired_gain_and_its_error():
    found = {
        "image": [
            {"f_score_tau_x100": f, "chamfer_l2_sq_x1000": 0.1234567, "seconds": 1.0} for f in (10.0, 20.0, 30.0)
        ],
        "nearest": [{"f_score_tau_x100": f, "chamfer_l2_sq_x1000": 1.0, "seconds": 1.0} for f in (11.0, 21.0, 31.0)],
        "depth": [{"f_score_tau_x100": f, "chamfer_l2_sq_x1000": 1.0, "seconds": 2.0} for f in (12.0, 24.0, 36.0)],
    }
    image, _, depth = complete.rows("chair", "test", found)
    assert "f_gain" not in image["error"] and image["size"]["shapes"] == 3
    assert (depth["error"]["f_gain"], depth["error"]["f_over_nearest"]) == pytest.approx((4, 3))
    assert depth["error"]["f_gain_error"] == pytest.approx(2 / np.sqrt(3))
    assert depth["median_s"] == 2
    assert image["each"] == {"f_score_tau_x100": [10, 20, 30], "chamfer_l2_sq_x1000": [0.12346] * 3}


def test_means_and_gains_in_git_are_those_of_every_shape():
    found = json.loads((measuring.REPORTS / "bench" / "complete.json").read_text())["rows"]
    committed = {row["what"]: row for row in found if "each" in row}
    groups: dict[str, dict[str, list[dict[str, float]]]] = {}
    for what, row in committed.items():  # as `rows` was given them, rounded
        group, _, way = what.partition(": ")
        scores = (dict(zip(row["each"], values, strict=True)) for values in zip(*row["each"].values(), strict=True))
        groups.setdefault(group, {})[way] = [{**one, "seconds": 0.0} for one in scores]
    for group, ways in groups.items():
        category, split = group.split(", ")
        for row in complete.rows(category, split, ways):
            told = committed[row["what"]]["error"]
            assert {name: told[name] for name in row["error"]} == pytest.approx(row["error"], abs=1e-3), row["what"]

"""The table of ray parametrisations: rays begin where they are said to, exact answers have no error."""

import dataclasses

import _shapes
import pytest

from bench.fields import parametrisations as benchmark
from ddf.core import seeding
from ddf.geometry import raycast, rays

LEVEL, RADIUS = 4, 0.6


@pytest.fixture(scope="module")
def _place():
    return benchmark.Place.of(_shapes.icosphere(LEVEL, RADIUS))


@pytest.fixture(autouse=True)
def _few(monkeypatch):
    few = {"TRAIN_CAMERAS": 6, "RAYS_EACH": 20, "INSIDE_RAYS": 300, "FREE_POINTS": 5, "LOOKS": 30, "SIZE": 24}
    for name, value in few.items():
        monkeypatch.setattr(benchmark, name, value)


def _exact(place):
    """What casting the mesh gives."""
    scene = raycast.Scene(place.mesh)

    def hits(p, v):
        return raycast.cast(scene, rays.OrientedPoints(p.double(), v.double()))

    return benchmark.Candidate(lambda p, v: hits(p, v).depth.float(), lambda p, v, _: hits(p, v).normals.float(), 0)


def test_an_exact_answer_has_no_error_and_a_late_one_has_its_delay(_place):
    seen, inner = benchmark.held_out(_place), benchmark.between(_place, seeding.generator(0, "test"))
    exact = _exact(_place)
    found = benchmark.outside_errors(exact, _place, seen)
    assert found["silhouette_iou"] == 1 and found["wrong_visibility"] == 0
    assert found["depth_mean"] < 1e-5 and found["normal_angle_deg_median"] < 0.1
    late = dataclasses.replace(exact, depth=lambda p, v: exact.depth(p, v) + 0.05)
    assert benchmark.outside_errors(late, _place, seen)["depth_median"] == pytest.approx(0.05, abs=1e-3)
    assert benchmark.inside_errors(exact, inner)["inside_wrong"] == 0
    wrong = benchmark.inside_errors(late, inner)["inside_wrong"]
    assert wrong == pytest.approx(float(inner.truth.visible.double().mean()))

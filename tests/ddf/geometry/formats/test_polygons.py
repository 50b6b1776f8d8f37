"""Polygons: every cut covers the polygon with its own corners, at any place and turn, or is refused by name."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ddf.core import checks
from ddf.geometry.formats import polygons


def _placed(flat, seed=0):
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.c_[flat, np.zeros(len(flat))] @ turn.T + rng.normal(size=3)


def _area(points, faces):
    a, b, c = (points[faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def _triangulate(*loops):
    points = np.concatenate(loops)
    counts = np.array([len(loop) for loop in loops])
    return points, *polygons.triangulate(points, counts, np.arange(len(points)))


def test_triangles_and_convex_polygons_stay_fans_in_order():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float64)
    _, faces, crossing = _triangulate(_placed(square), _placed(square[:3]))
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6]] and crossing == 0


@settings(max_examples=120, deadline=None)
@given(st.just(4) | st.integers(5, 40), st.integers(0, 10**6), st.integers(0, 3), st.sampled_from([1, -1]))
def test_stars_are_covered_from_any_corner_and_either_way_and_use_every_corner(corners, seed, start, step):
    rng = np.random.default_rng(seed)
    angle = np.arange(corners) * 2 * np.pi / corners + rng.uniform(-1.2, 1.2, corners) / corners
    flat = rng.uniform(0.1, 1.0, corners)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points, faces, crossing = _triangulate(_placed(np.roll(flat, start, axis=0)[::step], seed))
    assert crossing == 0 and set(faces.ravel()) == set(range(corners)) and len(faces) == corners - 2
    x, y = flat.T
    assert _area(points, faces) == pytest.approx(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2, rel=1e-9)


def test_quadrilateral_with_a_repeated_corner_or_three_on_a_line_is_covered():
    for flat in ([[0, 0], [2, 0], [2, 2], [2, 2]], [[0, 0], [1, 0], [2, 0], [2, 2]], [[0, 0], [2, 0], [2, 2], [0, 0]]):
        for start in range(4):
            points, faces, crossing = _triangulate(_placed(np.roll(np.array(flat, dtype=np.float64), start, axis=0)))
            assert crossing == 0 and _area(points, faces) == pytest.approx(2.0)


def test_corners_on_a_straight_line_are_kept():
    flat = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2], [0, 1]], dtype=np.float64)
    points, faces, _ = _triangulate(_placed(flat))
    assert set(faces.ravel()) == set(range(8)) and _area(points, faces) == pytest.approx(3.0)


def test_hole_on_a_bridge_is_cut_right_and_a_crossing_one_is_refused():
    ring = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 3], [3, 3], [3, 1], [1, 1]], dtype=np.float64)
    points, faces, _ = _triangulate(_placed(ring))
    assert _area(points, faces) == pytest.approx(12.0)
    crossed = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [1, 1], [3, 1], [3, 3], [1, 3]], dtype=np.float64)
    with pytest.raises(checks.InputError, match=r"polygon 1 \(8 corners\) crosses itself or has a hole"):
        _triangulate(_placed(crossed))


def test_crossed_quad_is_fanned_and_counted():
    bow = np.array([[0, 0], [1, 1], [1, 0], [0, 1.2]])
    _, faces, crossing = _triangulate(_placed(bow))
    assert crossing == 1 and faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_too_many_corners_are_refused():
    with pytest.raises(checks.InputError, match="corners; at most"):
        polygons.triangulate(np.zeros((3, 3)), np.array([200_000]), np.zeros(200_000, dtype=np.int64))

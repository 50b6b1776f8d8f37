"""Similarities between frames: inverse, composition, rays, JSON, and the frame of a mesh."""

import json

import numpy as np
import pytest

from ddf.core import checks
from ddf.geometry import transforms


def _random_similarity(seed):
    random = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(random.standard_normal((3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    return transforms.Similarity(random.uniform(0.1, 10), rotation, random.standard_normal(3))


def test_inverse_and_composition():
    outer, inner = _random_similarity(0), _random_similarity(1)
    points = np.random.default_rng(2).standard_normal((20, 3))
    np.testing.assert_allclose(outer.compose(inner).apply(points), outer.apply(inner.apply(points)), atol=1e-12)
    np.testing.assert_allclose(outer.inverse().apply(outer.apply(points)), points, atol=1e-12)


def test_rays_keep_meeting_their_points():
    frame = _random_similarity(3)
    position, direction, depth = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.6, 0.8]), np.array([1.7])
    moved = frame.apply(position) + frame.scale_depth(depth) * frame.apply_directions(direction)
    np.testing.assert_allclose(moved, frame.apply(position + depth * direction), atol=1e-12)
    assert frame.scale_depth(np.array([np.inf]))[0] == np.inf


def test_json_round_trip_is_exact():
    frame = _random_similarity(4)
    again = transforms.Similarity.from_dict(json.loads(json.dumps(frame.to_dict())))
    assert again.scale == frame.scale
    assert np.array_equal(again.rotation, frame.rotation)
    assert np.array_equal(again.translation, frame.translation)


def test_field_box_is_centred_with_longest_side_two_even_far_away():
    vertices = np.random.default_rng(5).uniform(0, 1, (50, 3)) * [1, 3, 2] + [1e6, -2e6, 5e5]
    box = transforms.field_from_mesh(vertices).apply(vertices)
    np.testing.assert_allclose((box.max(0) - box.min(0)).max(), 2.0, atol=1e-9)
    np.testing.assert_allclose(box.max(0) + box.min(0), 0.0, atol=1e-8)


def test_impossible_frames_are_refused():
    with pytest.raises(checks.InputError, match="scale must be positive"):
        transforms.Similarity(0.0)
    with pytest.raises(checks.InputError, match="rotation must be orthonormal"):
        transforms.Similarity(1.0, np.diag([1.0, 1.0, -1.0]))
    with pytest.raises(checks.InputError, match="at least one point"):
        transforms.field_from_mesh(np.zeros((0, 3)))


def test_corners_of_a_box_begin_and_end_with_those_that_name_it():
    corners = transforms.box_corners(np.array([0.0, 1.0, 2.0]), np.array([1.0, 3.0, 5.0]))
    assert corners[0].tolist() == [0, 1, 2] and corners[-1].tolist() == [1, 3, 5]
    assert len({tuple(corner) for corner in corners.tolist()}) == 8


GOOD = np.diag([2.0, 2, 2, 1])
BAD = {
    "words": ([["2", "0", "0", "0"], *GOOD[1:].tolist()], "4x4 matrix of numbers"),
    "true": ([*GOOD[:3].tolist(), [0, 0, 0, True]], "4x4 matrix of numbers"),
    "NaN": (GOOD * np.nan, "must be finite"),
    "huge": ([*GOOD[:3].tolist(), [0, 0, 0, 10**400]], "must be finite; got a number beyond 1e308"),
    "by columns": ((GOOD + np.outer([1, 2, 3, 0], [0, 0, 0, 1])).T, "stands in the last row: transpose it"),
    "projective": (GOOD + 1, "last row is 0, 0, 0, 1; got"),
}


@pytest.mark.parametrize("name", BAD)
def test_matrices_that_are_no_pose_are_told_by_name(name):
    with pytest.raises(checks.InputError, match=rf"^pose\.json.*{BAD[name][1]}"):
        transforms.Similarity.of_matrix("pose.json", BAD[name][0])

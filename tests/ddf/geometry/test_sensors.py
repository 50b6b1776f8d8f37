"""Sensors: their directions, where they look, and the faults of their ranges."""

import numpy as np
import pytest

from ddf.core import checks
from ddf.geometry import sensors, transforms


def test_fan_has_the_beams_of_every_column_and_no_direction_twice():
    directions = sensors.fan(3, 8, (-30.0, 30.0), (-180.0, 180.0))
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    np.testing.assert_allclose(np.degrees(np.arcsin(directions[:3, 2])), [-30, 0, 30], atol=1e-12)
    turns = np.degrees(np.arctan2(directions[1::3, 1], directions[1::3, 0])) % 360
    np.testing.assert_allclose(np.sort(turns), 45 * np.arange(8), atol=1e-9)
    assert len(np.unique(sensors.fan(1, 8, (0.0, 0.0), (180.0, -180.0)).round(9), axis=0)) == 8


@pytest.mark.parametrize(("axes", "ahead"), [(sensors.CAMERA, 2), (sensors.LIDAR, 0)])
def test_facing_looks_at_the_middle_of_a_box_whose_corners_are_all_in_view(axes, ahead):
    lower, upper = np.array([-3.0, 1.0, 0.0]), np.array([1.0, 2.0, 0.5])
    pose = sensors.facing(lower, upper, axes)
    corners = pose.inverse().apply(transforms.box_corners(lower, upper))
    middle = pose.inverse().apply((lower + upper) / 2)
    assert middle[ahead] == pytest.approx(np.linalg.norm(middle)) and corners[:, ahead].min() > 0
    angles = np.degrees(np.arccos(corners[:, ahead] / np.linalg.norm(corners, axis=1)))
    assert 20 < angles.max() < 25  # no farther than needed
    up = pose.rotation.T @ [0, 1, 0]
    assert (up[1] < 0) if ahead == 2 else (up[2] > 0)  # Y down of a camera, Z up of a lidar


def _measured(**faults):
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    depth = np.where(np.arange(20_000) % 4 == 0, np.inf, 2.0)
    return depth, sensors.measured(np.zeros_like(directions), directions, depth, -directions, **faults)


def test_faults_have_the_size_that_is_asked_for():
    depth, clean = _measured()
    np.testing.assert_array_equal(clean.ranges, depth)
    assert (clean.incidence_deg[clean.hit] < 1e-5).all() and np.isnan(clean.incidence_deg[~clean.hit]).all()
    np.testing.assert_allclose(clean.intensity, clean.hit, atol=1e-12)
    _, noisy = _measured(noise=0.05)
    off = noisy.ranges[noisy.hit] - 2
    assert off.std() == pytest.approx(0.05, rel=0.03) and abs(off.mean()) < 0.002
    _, stray = _measured(outliers=0.2)
    wrong = stray.ranges[stray.hit] != 2
    assert wrong.mean() == pytest.approx(0.2, abs=0.01)
    assert stray.ranges[stray.hit][wrong].max() == pytest.approx(4, abs=0.01)
    assert not _measured(reach=1.9)[1].hit.any()


@pytest.mark.parametrize("faults", [{"noise": -1.0}, {"outliers": 1.5}, {"reach": 0.0}, {"noise": np.nan}])
def test_faults_out_of_range_are_refused(faults):
    with pytest.raises(checks.InputError, match="noise must be 0 or more"):
        _measured(**faults)

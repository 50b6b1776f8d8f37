"""Simulated sensors: ranges and incidence of a sphere, a field seen whole, what no sensor is."""

import _shapes
import numpy as np
import pytest

import ddf
from ddf.core import checks

AWAY = np.eye(4)
AWAY[2, 3] = -3.0  # a camera that looks along its own Z at the origin
SPHERE = _shapes.icosphere(5)


@pytest.mark.parametrize("kind", ["camera", "lidar"])
def test_ranges_and_incidence_on_a_sphere_are_those_of_the_closed_form(kind):
    if kind == "camera":
        sweep = ddf.depth_camera(SPHERE, AWAY, size=(24, 32))
        assert sweep.ranges.shape == (24 * 32,)
    else:
        pose = np.eye(4)
        pose[0, 3] = -3.0
        other = np.diag([-1.0, -1.0, 1.0, 1.0])
        other[0, 3] = 3.0
        sweep = ddf.lidar(SPHERE, [pose, other], beams=16, columns=180)
        assert sweep.ranges.shape == (2 * 16 * 180,)
        assert (sweep.positions[: 16 * 180, 0] == -3).all() and (sweep.positions[16 * 180 :, 0] == 3).all()
    along = -(sweep.positions * sweep.directions).sum(axis=1)
    impact = np.sqrt(9 - along**2)
    clear = np.abs(impact - 1) > 0.01  # of the facets' silhouette
    np.testing.assert_array_equal(sweep.hit[clear], ((impact < 1) & (along > 0))[clear])
    inner = sweep.hit & (impact < 0.9)
    np.testing.assert_allclose(sweep.ranges[inner], along[inner] - np.sqrt(1 - impact[inner] ** 2), atol=3e-3)
    np.testing.assert_allclose(sweep.incidence_deg[inner], np.degrees(np.arcsin(impact[inner])), atol=4)
    assert inner.sum() > 40


def test_what_no_sensor_is_is_refused():
    with pytest.raises(checks.InputError, match="size must be a whole number, 1 or more"):
        ddf.depth_camera(SPHERE, size=0)
    with pytest.raises(checks.InputError, match="a pose must be a 4x4 matrix"):
        ddf.lidar(SPHERE, np.eye(3))
    with pytest.raises(checks.InputError, match="elevation and azimuth must be two angles"):
        ddf.lidar(SPHERE, elevation_deg=(0.0, 100.0))

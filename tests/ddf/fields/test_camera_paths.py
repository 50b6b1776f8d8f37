"""Cameras of scenes: the same pictures as `framed_field.camera_rays`, flights through waypoints."""

import numpy as np
import pytest
from _closed_form import ClosedForm

from ddf.core import checks
from ddf.fields import framed_field, scene_field
from ddf.geometry import primitives

FIELD = ClosedForm(primitives.Sphere(), np.array([-1.0, -0.4, -0.7]), np.array([1.0, 0.6, 0.7]))


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("camera", [(35.0, 25.0, 0.9), (-140.0, -60.0, 2.0)])
def test_one_camera_has_the_rays_of_a_render(camera, up):
    starts, directions = framed_field.camera_rays(FIELD, camera, 9, up)
    azimuth, elevation, radius = camera
    found = scene_field.one(FIELD, azimuth, elevation, radius, up).rays(9, up)
    np.testing.assert_allclose(found[0], starts, atol=1e-12)
    np.testing.assert_allclose(found[1], directions, atol=1e-12)


def test_flights_pass_every_waypoint_and_go_straight_between():
    stops = [scene_field.LookAt(np.array([i, i**2, 0.0]), np.array([i, i**2, 1.0])) for i in range(3)]
    looks = scene_field.fly(stops, 5)
    np.testing.assert_allclose(
        [look.position for look in looks], [[0, 0, 0], [0.5, 0.5, 0], [1, 1, 0], [1.5, 2.5, 0], [2, 4, 0]]
    )
    np.testing.assert_allclose([look.target - look.position for look in looks], [[0, 0, 1]] * 5)


def test_straight_in_ends_in_the_middle_of_the_box():
    start = scene_field.one(FIELD, 30.0, 10.0, 2.0, "y")
    first, last = scene_field.straight_in(FIELD, start)
    np.testing.assert_allclose(first.position, start.position)
    np.testing.assert_allclose(last.position, [0.0, 0.1, 0.0], atol=1e-12)
    way = last.position - first.position
    np.testing.assert_allclose(np.cross(way, last.target - last.position), 0.0, atol=1e-12)


def test_looking_straight_down_has_an_orientation():
    _, directions = scene_field.LookAt(np.array([0.0, 3.0, 0.0]), np.zeros(3)).rays(3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    np.testing.assert_allclose(directions[4], [0.0, -1.0, 0.0], atol=1e-12)


def test_cameras_that_cannot_look_are_refused():
    with pytest.raises(checks.InputError, match="must look away from where it stands"):
        scene_field.LookAt(np.ones(3), np.ones(3))
    with pytest.raises(checks.InputError, match="finite"):
        scene_field.LookAt(np.ones(3), np.full(3, np.nan))
    with pytest.raises(checks.InputError, match="two waypoints or more; got 1"):
        scene_field.fly([scene_field.LookAt(np.ones(3), np.zeros(3))], 4)

"""Poses: rotations in closed form, renders of moved objects, and poses found again from one depth image."""

import numpy as np
import pytest
import torch

from ddf.core import shipped_models
from ddf.fields.scenes import pose
from ddf.fit import shape_field


@pytest.fixture(scope="module")
def rabbit():
    return shape_field.load(shipped_models.place("rabbit"))


def test_rotation_is_that_about_the_axis():
    quarter = pose.Pose(torch.tensor([0.0, 0.0, np.pi / 2]), torch.zeros(3)).rotation()
    np.testing.assert_allclose(quarter, [[0.0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-6)
    rest = pose.Pose(torch.zeros(3, requires_grad=True), torch.zeros(3))
    (slope,) = torch.autograd.grad(rest.rotation()[1, 0], rest.turn)
    np.testing.assert_allclose(slope, [0.0, 0.0, 1.0], atol=1e-6)


def test_difference_is_the_angle_and_the_distance():
    one = pose.Pose(torch.tensor([0.1, 0.0, 0.0]), torch.zeros(3))
    other = pose.Pose(torch.tensor([0.3, 0.0, 0.0]), torch.tensor([0.0, 3.0, 4.0]))
    assert pose.difference(one, other) == pytest.approx((np.degrees(0.2), 5.0), abs=1e-2)


def test_an_object_moved_with_its_camera_looks_the_same(rabbit):
    view = pose.image_rays(8)
    at = pose.Pose(torch.tensor([0.2, -0.4, 0.1]), torch.tensor([0.3, 0.1, -0.5]))
    turn = at.rotation()
    moved = (view[0] @ turn.T + at.shift, view[1] @ turn.T)
    still, seen = pose.render(rabbit, pose.Pose(torch.zeros(3), torch.zeros(3)), view), pose.render(rabbit, at, moved)
    np.testing.assert_allclose(seen.visibility.detach(), still.visibility.detach(), atol=1e-3)
    both = still.visibility > 0.5
    np.testing.assert_allclose(seen.depth[both].detach(), still.depth[both].detach(), atol=1e-3)


def test_a_pose_is_found_again_to_a_degree_and_a_hundredth(rabbit):
    axis = torch.tensor([0.3, 1.0, -0.2])
    true = pose.Pose(np.radians(12.0) * axis / axis.norm(), torch.tensor([0.06, -0.04, 0.07]))
    view = pose.image_rays(24)
    with torch.no_grad():
        image = pose.render(rabbit, true, view)
    assert pose.difference(pose.Pose(torch.zeros(3), torch.zeros(3)), true)[0] > 10
    angle, shift = pose.difference(pose.recover(rabbit, image, view, steps=120), true)
    assert angle < 1 and shift < 0.01

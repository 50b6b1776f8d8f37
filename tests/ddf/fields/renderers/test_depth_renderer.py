"""The tangent pass of a depth renderer against differences of its values; its sizes."""

import pytest
import torch
from _support import assert_close

from ddf.core import checks
from ddf.fields.renderers import depth_renderer, image_properties
from ddf.geometry import cameras

LAYOUT = depth_renderer.RendererLayout(8, (5, 4, 3, 3, 2))
STEP = 1e-5


def _renderer():
    torch.manual_seed(0)
    return depth_renderer.DepthRenderer(LAYOUT).double().requires_grad_(False)


def _views():
    angles = torch.tensor([[0.6, 2.0], [0.5, -0.2], [2.6, 3.0]], dtype=torch.float64)
    axes, centres = cameras.extrinsics(*angles)
    return image_properties.Views(centres, axes)


def _moved(views, axis, by):
    return image_properties.Views(views.positions + by * torch.eye(3).double()[axis], views.axes)


def _turned(views, axis, by):
    skew = torch.linalg.cross(torch.eye(3).double()[axis].expand(3, 3), torch.eye(3).double()).T
    return image_properties.Views(views.positions, views.axes @ torch.linalg.matrix_exp(by * skew).T)


def test_derivatives_in_the_camera_are_differences_of_values():
    renderer, views = _renderer(), _views()
    values, moved, turned = renderer.with_derivatives(views)
    assert_close(values, renderer(views))
    for change, found in ((_moved, moved), (_turned, turned)):
        for axis in range(3):
            ahead, behind = (renderer(change(views, axis, sign * STEP)) for sign in (1, -1))
            assert_close(found[..., axis], (ahead - behind) / (2 * STEP), atol=1e-7)
    assert turned.abs().amax((0, 2, 3)).min() > 1e-2  # of both channels, about every axis


def test_a_turn_moves_directions_by_its_cross_product():
    views = _views()
    change = (_turned(views, 1, STEP).directions(8) - _turned(views, 1, -STEP).directions(8)) / (2 * STEP)
    axis = torch.eye(3).double()[1].expand_as(change)
    assert_close(change, torch.linalg.cross(axis, views.directions(8)), atol=1e-8)


def test_a_pixel_depends_on_the_rays_around_it():
    """Which a field asked ray by ray does not: two pixels of one ray, in images that are turned otherwise, differ."""
    renderer, views = _renderer(), _views()
    upside_down = image_properties.Views(views.positions, views.axes * torch.tensor([-1.0, -1.0, 1.0])[:, None])
    assert_close(upside_down.directions(8).flip(1, 2), views.directions(8))
    difference = renderer(upside_down).flip(2, 3) - renderer(views)
    assert difference.abs().max() > 1e-3


@pytest.mark.parametrize("image", [0, 30])
def test_sizes_that_cannot_be_halved_twice_are_named(image):
    with pytest.raises(checks.InputError, match=f"multiple of 4; got {image}"):
        depth_renderer.RendererLayout(image)

"""Pictures of the report: geometry, colours and conventions in closed form."""

import matplotlib  # noqa: TID251
import numpy as np
import torch

from ddf.geometry import cameras
from ddf.pictures import field_pictures, picture_strips

_CAMERA = np.array([0.7, 0.45, 0.8])
_WHITE = np.full(3, 255)


def _dark(picture):
    """Rows and columns of pixels that are not white."""
    return np.argwhere((picture < 250).any(axis=-1))


def test_a_point_is_drawn_where_the_camera_projects_it():
    point = np.array([[0.1, -0.05, 0.12]])
    picture = picture_strips.cloud_picture(point, np.zeros((1, 3)), _CAMERA, size=137)
    extrinsics = cameras.extrinsics(*torch.from_numpy(_CAMERA))
    column, row = (float(value[0]) for value in cameras.project(torch.from_numpy(point), *extrinsics))
    centre = _dark(picture).mean(axis=0) + 0.5
    assert np.abs(centre - [row, column]).max() < 0.6


def test_the_nearest_point_covers_the_farther_one():
    direction = cameras.position(*torch.from_numpy(_CAMERA)).numpy()
    points = np.stack([0.2 * direction, -0.2 * direction])  # on one ray through the centre; the first is nearer
    colours = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    for order in ([0, 1], [1, 0]):
        picture = picture_strips.cloud_picture(points[order], colours[order], _CAMERA, size=137)
        centre = picture[68, 68].astype(int)
        assert centre[0] > 200 and centre[2] < 40


def test_points_behind_the_camera_or_outside_the_frame_are_left_out():
    position = cameras.position(*torch.from_numpy(_CAMERA)).numpy()
    outside = np.stack([2 * position, position + 5 * np.array([1.0, 0, 0])])
    picture = picture_strips.cloud_picture(outside, np.zeros((2, 3)), _CAMERA, size=64)
    assert (picture == 255).all()


def test_colours_are_coordinates_within_the_reference_box():
    reference = np.array([[-1.0, 0.0, 2.0], [1.0, 4.0, 3.0]])
    points = np.array([[-1.0, 4.0, 2.5], [5.0, -9.0, 3.0]])
    np.testing.assert_allclose(
        picture_strips.coordinate_colours(points, reference), [[0.08, 0.92, 0.5], [0.92, 0.08, 0.92]], atol=1e-12
    )


def test_depth_is_viridis_with_near_yellow_and_white_where_nothing_is_seen():
    depth = np.array([[1.0, 2.0], [1.5, np.inf]])
    visibility = np.array([[0.9, 0.8], [0.2, 0.9]])
    picture = field_pictures.depth_picture(depth, visibility)
    ends = np.rint(255 * field_pictures.colours(np.array([1.0, 0.0]))).astype(int)
    assert np.abs(picture[0].astype(int) - ends).max() <= 1
    assert (picture[1] == 255).all()
    assert (field_pictures.depth_picture(depth, np.zeros((2, 2))) == 255).all()


def test_normals_are_shifted_components():
    normals = np.array([[[1.0, 0.0, -1.0], [0.0, 1.0, 0.0]]]).repeat(2, axis=0)
    picture = field_pictures.normals_picture(normals, np.array([[1.0, 0.4], [1.0, 0.6]]))
    assert (picture[0, 0] == [255, 128, 0]).all() and (picture[0, 1] == _WHITE).all()
    assert (picture[1, 1] == [128, 255, 128]).all()


def test_visibility_and_alpha_meet_white():
    assert (field_pictures.visibility_picture(np.zeros((2, 2))) == 255).all()
    assert field_pictures.visibility_picture(np.ones((1, 1))).max() < 80
    rgba = np.array([[[0.2, 0.4, 0.6, 1.0], [0.0, 0.0, 0.0, 0.0]]]).repeat(2, axis=0)
    assert (picture_strips.on_white(rgba)[0] == [[51, 102, 153], [255, 255, 255]]).all()


def test_colours_are_those_of_matplotlib_in_bytes():
    levels = np.concatenate([np.linspace(0.0, 1.0, 1001), np.arange(257) / 256])
    expected = matplotlib.colormaps["viridis"](levels)[..., :3]
    assert np.array_equal(np.rint(field_pictures.colours(levels) * 255), np.rint(expected * 255))
    np.testing.assert_allclose(
        field_pictures.colours(np.array([0.0, 1.0])), [[0.267, 0.005, 0.329], [0.993, 0.906, 0.144]], atol=2e-3
    )

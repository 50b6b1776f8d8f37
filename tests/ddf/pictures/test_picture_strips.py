"""Pictures of the report: geometry, colours and conventions in closed form."""

import numpy as np
import torch

from ddf.geometry import cameras
from ddf.pictures import field_pictures, picture_strips

_CAMERA = np.array([0.7, 0.45, 0.8])


def test_a_point_is_drawn_where_the_camera_projects_it():
    point = np.array([[0.1, -0.05, 0.12]])
    picture = picture_strips.cloud_picture(point, np.zeros((1, 3)), _CAMERA, size=137)
    extrinsics = cameras.extrinsics(*torch.from_numpy(_CAMERA))
    column, row = (float(value[0]) for value in cameras.project(torch.from_numpy(point), *extrinsics))
    dark = np.argwhere((picture < 250).any(axis=-1))  # rows and columns of pixels that are not white
    centre = dark.mean(axis=0) + 0.5
    assert np.abs(centre - [row, column]).max() < 0.6


def test_depth_is_viridis_with_near_yellow_and_white_where_nothing_is_seen():
    depth = np.array([[1.0, 2.0], [1.5, np.inf]])
    visibility = np.array([[0.9, 0.8], [0.2, 0.9]])
    picture = field_pictures.depth_picture(depth, visibility)
    ends = np.rint(255 * field_pictures.colours(np.array([1.0, 0.0]))).astype(int)
    assert np.abs(picture[0].astype(int) - ends).max() <= 1
    assert (picture[1] == 255).all()
    assert (field_pictures.depth_picture(depth, np.zeros((2, 2))) == 255).all()

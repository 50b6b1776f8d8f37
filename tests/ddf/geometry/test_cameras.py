"""Facts of the 3D-R2N2 cameras, and what follows from them."""

import math

import torch

from ddf.geometry import cameras


def _tensor(*values):
    return torch.tensor(values, dtype=torch.float64)


def test_known_camera():
    rotation, centre = cameras.extrinsics(*_tensor(math.radians(30), math.radians(25), 0.8).unbind())
    expected = _tensor(
        [0.5, 0, -0.8660254], [-0.36599815, 0.90630779, -0.21130913], [0.78488557, 0.42261826, 0.45315389]
    )
    torch.testing.assert_close(rotation, expected, rtol=0, atol=1e-6)
    torch.testing.assert_close(centre, _tensor(0.62790845, 0.33809461, 0.36252311), rtol=0, atol=1e-6)
    torch.testing.assert_close(rotation @ -centre, _tensor(0, 0, -0.8), rtol=0, atol=1e-12)


def test_closed_form_equals_cross_products():
    azimuth, elevation = _tensor(0.3, 2.0, 5.1), _tensor(0.1, 0.45, -0.6)
    rotation, centre = cameras.extrinsics(azimuth, elevation, _tensor(0.7, 0.8, 0.9))
    backwards = torch.nn.functional.normalize(centre, dim=-1)
    right = torch.nn.functional.normalize(torch.linalg.cross(_tensor(0, 1, 0).expand(3, 3), backwards), dim=-1)
    expected = torch.stack((right, torch.linalg.cross(backwards, right), backwards), dim=-2)
    torch.testing.assert_close(rotation, expected, rtol=0, atol=1e-12)


def test_points_along_a_pixel_ray_project_to_that_pixel():
    camera = _tensor(1.1, 0.4, 0.75)
    rotation, centre = cameras.extrinsics(camera[0], camera[1], camera[2])
    for size in (137, 64, 32):
        directions = cameras.pixel_directions(size, torch.zeros(0, dtype=torch.float64))
        origin, world = cameras.pixel_rays(camera[0], camera[1], camera[2], directions.reshape(-1, 3))
        u, v = cameras.project(origin + 0.6 * world, rotation, centre)
        centres = (torch.arange(size, dtype=torch.float64) + 0.5) * 137 / size
        torch.testing.assert_close(u.reshape(size, size), centres.expand(size, size), rtol=0, atol=1e-9)
        torch.testing.assert_close(v.reshape(size, size), centres[:, None].expand(size, size), rtol=0, atol=1e-9)


def test_up_in_the_world_is_up_in_the_image():
    rotation, centre = cameras.extrinsics(*_tensor(0.7, 0.45, 0.8).unbind())
    u, v = cameras.project(_tensor([0, 0, 0], [0, 0.1, 0]), rotation, centre)
    torch.testing.assert_close(u, _tensor(68.5, 68.5))
    assert v[1] < v[0]

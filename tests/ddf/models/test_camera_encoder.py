"""The mask's numbers by closed forms, the radius by the apparent size, mirrored cameras by what they project."""

import math

import numpy as np
import pytest
import torch

from ddf.geometry import cameras
from ddf.models import camera_encoder, encoders


def _rectangle(left, right, top, bottom, size=32):
    """A rectangle of half sides of the image, edges within pixels as shares of these."""

    def share(low, high):
        edges = torch.arange(size + 1, dtype=torch.float64) * 2 / size - 1
        return ((edges[1:].clamp(low, high) - edges[:-1].clamp(low, high)) * size / 2).float()

    return (share(top, bottom)[:, None] * share(left, right))[None]


def test_numbers_of_a_rectangle():
    left, right, top, bottom = -0.6125, 0.4, -0.25, 0.30625
    width, height = right - left, bottom - top
    size = math.sqrt((width**2 + height**2) / 12)
    x, y = (left + right) / 2, (top + bottom) / 2
    expected = [math.log(size), x, y, width**2 / 12 / size**2, 0, math.sqrt(width * height) / size]
    expected += [-width / 2 / size, width / 2 / size, -height / 2 / size, height / 2 / size]
    found = camera_encoder.mask_numbers(_rectangle(left, right, top, bottom))[0]
    assert found.tolist() == pytest.approx(expected, abs=0.01)


def test_covariance_of_two_squares_on_the_diagonal_and_an_empty_mask():
    both = _rectangle(-0.5, -0.25, -0.5, -0.25) + _rectangle(0.25, 0.5, 0.25, 0.5)
    apart, own = 0.375**2, (0.25**2 - (2 / 32) ** 2) / 12  # of centres of pixels
    assert float(camera_encoder.mask_numbers(both)[0, 4]) == pytest.approx(apart / (2 * (apart + own)), rel=1e-4)
    assert bool(torch.isfinite(camera_encoder.mask_numbers(torch.zeros(2, 8, 8))).all())


def test_radius_is_inverse_to_the_apparent_size():
    """Whatever the network answers: with constant answers, a mask of half the size is seen from twice as far."""
    encoder = camera_encoder.StatisticsAwareEncoder(encoders.ResNet18, 4, 4).eval()
    near, usual, far = (_rectangle(-half, half, -half, half, 64) for half in (0.5, 0.375, 0.25))
    radii = torch.tensor([0.7, 0.8, 0.9])
    encoder.fit(torch.cat([near, usual, far]), radii)
    with torch.no_grad():
        encoder.scores.weight.zero_()
        encoder.scores.bias.copy_(torch.tensor([0.0, 0.0, 0.0, 0.5]))
        scores = encoder(torch.cat([near, far])[:, None].expand(-1, 4, -1, -1))
    found = radii.mean() + radii.std() * scores[:, 3]
    assert float(found[1] / found[0]) == pytest.approx(2, rel=3e-3)
    root = math.exp(float(encoder.mean[0])) / (0.5 * math.sqrt(2 / 3))
    assert float(found[0]) == pytest.approx(0.8 * math.exp(0.5 * 0.1 / 0.8) * root, rel=3e-3)


def test_a_mirrored_camera_sees_the_mirrored_shape_left_for_right():
    random = np.random.default_rng(0)
    points, camera = random.uniform(-0.2, 0.2, (20, 3)), np.array([0.7, 0.4, 0.8])
    u, v = cameras.project(points, *cameras.extrinsics(*camera))
    other = cameras.mirrored(camera)
    mirrored = cameras.project(points * [1, 1, -1], *cameras.extrinsics(*other))
    np.testing.assert_allclose(mirrored, (cameras.IMAGE_SIZE - u, v))
    assert 0 <= other[0] < 2 * math.pi
    np.testing.assert_allclose(cameras.mirrored(other), camera)

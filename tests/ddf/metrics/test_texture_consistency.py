"""Colours of a painted sphere from two cameras."""

import math

import torch

from ddf.geometry import cameras
from ddf.metrics import image_scores

RADIUS, SIZE = 0.3, 64


def _picture(azimuth, paint):
    """A sphere about the origin, each point coloured by `paint`."""
    camera = torch.tensor([azimuth, 0.4, 1.0])
    directions = cameras.pixel_directions(SIZE, camera).reshape(-1, 3)
    centre, world = cameras.pixel_rays(camera[0], camera[1], camera[2], directions)
    along = (world * centre).sum(-1)
    inside = along.square() - centre.square().sum() + RADIUS**2
    distance = torch.where(inside >= 0, -along - inside.clamp(min=0).sqrt(), torch.inf)
    points = centre + torch.where(inside >= 0, distance, 0.0)[:, None] * world
    colours = torch.where((inside >= 0)[:, None], paint(points), 1.0)
    return image_scores.CameraPicture(
        camera, distance.reshape(SIZE, SIZE), colours.T.reshape(3, SIZE, SIZE).contiguous()
    )


def _by_place(points):
    return points / (2 * RADIUS) + 0.5


def test_paint_that_stays_on_the_surface_has_a_small_error_and_paint_that_does_not_a_known_one():
    first, second = _picture(0.5, _by_place), _picture(1.0, _by_place)
    kept, count = image_scores.colour_error([(first, second), (second, first)])
    assert kept < 0.03 and count > 500
    other = _picture(1.0, lambda points: 0.5 * _by_place(points))
    changed, _ = image_scores.colour_error([(first, other)])
    assert changed > 5 * kept
    dark, light = (
        _picture(turn, lambda points, v=v: torch.full_like(points, v)) for turn, v in ((0.5, 0.2), (1.0, 0.7))
    )
    inner = image_scores.colour_differences(dark, light)
    assert abs(float(inner.median()) - 0.5) < 1e-5  # at the outline some of the white around is mixed in


def test_points_behind_the_surface_are_not_compared():
    first, second = _picture(0.0, _by_place), _picture(math.pi, _by_place)
    seen = int(first.distance.isfinite().sum())
    assert len(image_scores.colour_differences(first, second)) < 0.35 * seen
    assert len(image_scores.colour_differences(first, first)) > 0.9 * seen

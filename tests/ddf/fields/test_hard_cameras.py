"""Hard cameras: on the box, far away, at the pole, past a full turn, looking away. Truth: fields of constant depth."""

import math

import numpy as np
import pytest
import torch
from _hard import FAR, assert_exact, assert_within, constant_field, step

from ddf.fields import framed_field, rendering, shape_field
from ddf.geometry import cameras, rays, transforms

AHEAD = 0.5  # depth of the constant field
DIAGONAL = math.atan(1 / math.sqrt(2))  # elevation of the cube's corner
FRAME_SCALE = transforms.BENCHMARK_FROM_V1  # with this scale the field's unit is the benchmark's


def _field(dtype):
    return constant_field((AHEAD, AHEAD, 0, 20), dtype)


def _render(camera, size, dtype):
    scale = torch.tensor(FRAME_SCALE, dtype=dtype)
    return rendering.render(_field(dtype), None, torch.tensor(camera, dtype=dtype), scale, size)


def _image(value, size):
    return torch.full((size, size), value, dtype=torch.float64)


@pytest.mark.parametrize(
    "camera", [(0.0, 0.0, 1.0), (math.pi / 4, 0.0, math.sqrt(2)), (math.pi / 4, DIAGONAL, math.sqrt(3))]
)
def test_cameras_on_a_face_an_edge_and_a_corner_ask_every_ray(camera, dtype):
    """64 ε: a start ε outside, rays 2 degrees off a face."""
    images, queries = _render(camera, 16, dtype)
    assert queries == 256
    assert_within(images["depth"], _image(AHEAD, 16), 64 * step(dtype))


def test_a_camera_at_the_centre_sees_the_depth_exactly(dtype):
    images, queries = _render((0.3, 0.4, 0.0), 8, dtype)
    assert queries == 64
    assert_exact(images["depth"], _image(AHEAD, 8))


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (0.7, 0.3), (-2.0, -0.5)])
def test_a_camera_a_thousand_boxes_away_asks_one_ray(azimuth, elevation, dtype):
    """The box is a tenth of a pixel: depth 2,000 - 1/max|v_i| + 1/2 there, elsewhere inf, ξ = 0 and zero normals."""
    images, queries = _render((azimuth, elevation, 2000.0), 3, dtype)
    high, flat = math.sin(elevation), math.cos(elevation)
    depth, seen = _image(math.inf, 3), _image(0.0, 3)
    depth[1, 1] = 2000 - 1 / max(abs(flat * math.cos(azimuth)), abs(high), abs(flat * math.sin(azimuth))) + AHEAD
    seen[1, 1] = 1.0
    assert queries == 1
    assert_within(images["visibility"], seen, 1e-6)
    assert_exact(images["normals"], torch.zeros(3, 3, 3))
    assert_within(images["depth"], depth, 4000 * step(dtype))


def test_rays_a_thousand_boxes_away_from_a_mesh_1e6_from_its_origin(dtype):
    """A mesh 2,048 units long: depth exactly 1,999.5 half lengths in its units; the ray beside the box misses."""
    half = 1024.0
    frame = transforms.Similarity(1 / half, np.eye(3), -FAR / half)
    shape = shape_field.ShapeField(_field(dtype), -np.ones(3), np.ones(3), frame, {})
    start = torch.from_numpy(FAR).repeat(2, 1) - torch.tensor([[2000 * half, 0, 0], [2000 * half, 2 * half, 0]])
    looking = torch.tensor([1.0, 0.0, 0.0], dtype=dtype).expand(2, 3)
    found, queries = framed_field.query(shape, rays.OrientedPoints(start.to(dtype), looking))
    assert queries == 1
    assert_exact(found["depth"], [(1999 + AHEAD) * half, math.inf])
    assert_exact(found["visibility"][1], 0.0)


def test_a_camera_that_looks_away_meets_nothing(dtype):
    camera = torch.tensor([0.4, 0.2, 3.0], dtype=dtype)
    directions = -cameras.pixel_directions(8, torch.zeros(0, dtype=dtype)).reshape(-1, 3)
    entry, _, distance, meets = rendering.field_rays(camera, torch.tensor(FRAME_SCALE, dtype=dtype), directions)
    high, flat = math.sin(0.2), math.cos(0.2)
    centre = 3 * torch.tensor([flat * math.cos(0.4), high, flat * math.sin(0.4)], dtype=torch.float64)
    assert not meets.any()
    assert_exact(distance, torch.zeros(64))
    assert_within(entry, centre.expand(64, 3), 8 * step(dtype))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_at_the_poles_the_azimuth_is_the_roll(sign, dtype):
    """X = (sin θ, 0, -cos θ), Y = ∓(cos θ, 0, sin θ), Z = (0, ±1, 0)."""
    azimuth = torch.deg2rad(torch.arange(0, 360, 50, dtype=torch.float64)).to(dtype)
    sin, cos, zero = azimuth.double().sin(), azimuth.double().cos(), torch.zeros_like(azimuth.double())
    rotation = cameras.rotation(azimuth, torch.full_like(azimuth, sign * math.pi / 2))
    rows = ((sin, zero, -cos), (-sign * cos, zero, -sign * sin), (zero, zero + sign, zero))
    assert_within(rotation, torch.stack([torch.stack(row, -1) for row in rows], dim=-2), 2 * step(dtype))

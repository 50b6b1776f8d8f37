"""Hard cameras: on the box, far away, at the pole, past a full turn, looking away. Truth: fields of constant depth."""

import math

import numpy as np
import torch
from torch import Tensor

from ddf.fields import framed_field, rendering, shape_field
from ddf.geometry import cameras, rays, transforms
from ddf.metrics import camera_errors

from . import case
from .field_cases import constant_field

CAMERAS = case.Group("cameras")
AHEAD = 0.5  # depth of the constant field
DIAGONAL = math.atan(1 / math.sqrt(2))  # elevation of the cube's corner
FRAME_SCALE = transforms.BENCHMARK_FROM_V1  # with this scale the field's unit is the benchmark's


def _render(camera: tuple[float, float, float], size: int, dtype: torch.dtype) -> tuple[dict[str, Tensor], int]:
    field = constant_field((AHEAD, AHEAD, 0, 20), dtype)
    scale = torch.tensor(FRAME_SCALE, dtype=dtype)
    return rendering.render(field, None, torch.tensor(camera, dtype=dtype), scale, size)


def _image(values: float, size: int) -> Tensor:
    return torch.full((size, size), values, dtype=torch.float64)


@CAMERAS.case(
    "on a face, an edge and a corner of the box",
    "cameras on the boundary of the field's cube that look at its centre, 16 x 16 pixels, constant depth 1/2",
    "all 256 rays are asked; depth 1/2 within 64 ε (a start ε outside, rays 2 degrees off a face)",
)
def _on_box(dtype: torch.dtype) -> case.Outcome:
    found = []
    for camera in ((0.0, 0.0, 1.0), (math.pi / 4, 0.0, math.sqrt(2)), (math.pi / 4, DIAGONAL, math.sqrt(3))):
        images, queries = _render(camera, 16, dtype)
        found.append(case.Outcome(f"{queries} rays", queries == 256))
        found.append(case.close(images["depth"], _image(AHEAD, 16), 64 * case.step(dtype)))
    return case.worst(*found)


@CAMERAS.case(
    "exactly on a corner, looking along its faces",
    "start (1, 1, 1), directions along the three edges, inwards and outwards",
    "entry at the start, distance exactly 0: the closed box holds its corner",
)
def _corner(dtype: torch.dtype) -> case.Outcome:
    one = torch.ones(3, dtype=dtype)
    directions = torch.cat((torch.eye(3, dtype=dtype), -torch.eye(3, dtype=dtype)))
    starts = one.expand(6, 3)
    entry, distance, meets = rays.enter_box(starts, directions, -one, one)
    return case.every(case.true("all meet it", meets), case.exact(distance, torch.zeros(6)), case.exact(entry, starts))


@CAMERAS.case(
    "at the box's centre",
    "radius 0, 8 x 8 pixels, constant depth 1/2",
    "all 64 rays are asked; depth exactly 1/2",
)
def _at_centre(dtype: torch.dtype) -> case.Outcome:
    images, queries = _render((0.3, 0.4, 0.0), 8, dtype)
    return case.every(case.Outcome(f"{queries} rays", queries == 64), case.exact(images["depth"], _image(AHEAD, 8)))


@CAMERAS.case(
    "1e3 box lengths away",
    "radius 2,000 from three sides, 3 x 3 pixels: the box is a tenth of a pixel",
    "one ray asked; depth 2,000 - 1/max|v_i| + 1/2 within 4,000 ε; elsewhere inf, ξ = 0 and zero normals",
)
def _far(dtype: torch.dtype) -> case.Outcome:
    found = []
    for azimuth, elevation in ((0.0, 0.0), (0.7, 0.3), (-2.0, -0.5)):
        images, queries = _render((azimuth, elevation, 2000.0), 3, dtype)
        looking = (
            math.cos(elevation) * math.cos(azimuth),
            math.sin(elevation),
            math.cos(elevation) * math.sin(azimuth),
        )
        depth, seen = _image(math.inf, 3), _image(0.0, 3)
        depth[1, 1], seen[1, 1] = 2000 - 1 / max(map(abs, looking)) + AHEAD, 1.0
        found.append(case.close(images["visibility"], seen, 1e-6))
        found.append(case.exact(images["normals"], torch.zeros(3, 3, 3)))
        found.append(case.Outcome(f"{queries} rays", queries == 1))
        found.append(case.close(images["depth"], depth, 4000 * case.step(dtype)))
    return case.worst(*found)


@CAMERAS.case(
    "1e3 box lengths away from a mesh 1e6 from its origin",
    "a field of a mesh around (1e6, -1e6, 5e5), 2,048 units long; rays from 2,048,000 units before it, along x",
    "one ray asked; depth exactly 1,999.5 half lengths in mesh units; the ray beside the box misses",
)
def _far_shape(dtype: torch.dtype) -> case.Outcome:
    centre, half = np.array([1e6, -1e6, 5e5]), 1024.0
    frame = transforms.Similarity(1 / half, np.eye(3), -centre / half)
    field = constant_field((AHEAD, AHEAD, 0, 20), dtype)
    shape = shape_field.ShapeField(field, -np.ones(3), np.ones(3), frame, {})
    start = torch.from_numpy(centre).repeat(2, 1) - torch.tensor([[2000 * half, 0, 0], [2000 * half, 2 * half, 0]])
    looking = torch.tensor([1.0, 0.0, 0.0], dtype=dtype).expand(2, 3)
    found, queries = framed_field.query(shape, rays.OrientedPoints(start.to(dtype), looking))
    return case.every(
        case.Outcome(f"{queries} rays", queries == 1),
        case.exact(found["depth"], [(1999 + AHEAD) * half, math.inf]),
        case.exact(found["visibility"][1], 0.0),
    )


@CAMERAS.case(
    "looking away from the box",
    "a camera at radius 3 with its pixel directions reversed, 64 rays",
    "no ray meets the box, no NaN: starts unmoved, distance 0",
)
def _away(dtype: torch.dtype) -> case.Outcome:
    camera = torch.tensor([0.4, 0.2, 3.0], dtype=dtype)
    directions = -cameras.pixel_directions(8, torch.zeros(0, dtype=dtype)).reshape(-1, 3)
    entry, _, distance, meets = rendering.field_rays(camera, torch.tensor(FRAME_SCALE, dtype=dtype), directions)
    high, away = math.sin(0.2), math.cos(0.2)
    centre = 3 * torch.tensor([away * math.cos(0.4), high, away * math.sin(0.4)], dtype=torch.float64)
    return case.every(
        case.true("none meets it", ~meets),
        case.worst(
            case.exact(distance, torch.zeros(64)), case.close(entry, centre.expand(64, 3), 8 * case.step(dtype))
        ),
    )


@CAMERAS.case(
    "at the poles",
    "elevations of ±90 degrees, azimuths of 0, 50, ..., 350 degrees",
    "X = (sin θ, 0, -cos θ), Y = ∓(cos θ, 0, sin θ), Z = (0, ±1, 0) within 2 ε: the azimuth is the roll",
)
def _poles(dtype: torch.dtype) -> case.Outcome:
    degrees = torch.arange(0, 360, 50, dtype=torch.float64)
    found, azimuth = [], torch.deg2rad(degrees).to(dtype)
    sin, cos, zero = azimuth.double().sin(), azimuth.double().cos(), torch.zeros(len(degrees), dtype=torch.float64)
    for sign in (1.0, -1.0):
        rotation = cameras.rotation(azimuth, torch.full_like(azimuth, sign * math.pi / 2))
        rows = ((sin, zero, -cos), (-sign * cos, zero, -sign * sin), (zero, zero + sign, zero))
        expected = torch.stack([torch.stack(row, -1) for row in rows], dim=-2)
        found.append(case.close(rotation, expected, 2 * case.step(dtype)))
    return case.worst(*found)


@CAMERAS.case(
    "azimuths past a full turn",
    "the rays of cameras at θ and at θ ± 2π, for θ = -π, 0, 0.1, 3",
    "equal within 8 ε, which is the rounding of θ ± 2π",
)
def _full_turn(dtype: torch.dtype) -> case.Outcome:
    azimuth = torch.tensor([-math.pi, 0.0, 0.1, 3.0], dtype=dtype)
    elevation, radius = torch.full_like(azimuth, 0.4), torch.ones_like(azimuth)
    pixels = cameras.pixel_directions(4, torch.zeros(0, dtype=dtype)).reshape(-1, 3)
    found = []
    centre, world = cameras.pixel_rays(azimuth, elevation, radius, pixels)
    for turn in (2 * math.pi, -2 * math.pi):
        again, turned = cameras.pixel_rays(azimuth + turn, elevation, radius, pixels)
        found += [case.close(again, centre, 8 * case.step(dtype)), case.close(turned, world, 8 * case.step(dtype))]
    return case.worst(*found)


@CAMERAS.case(
    "differences of azimuths",
    "359.9 against 0.1 degrees, 0.1 against 359.9, 180 against -180, 0 against 180, 725 against 5",
    "0.2, 0.2, 0, 180, 0 degrees within 1e3 ε",
)
def _differences(dtype: torch.dtype) -> case.Outcome:
    first, second = (
        torch.deg2rad(torch.tensor(degrees, dtype=torch.float64)).to(dtype).numpy()
        for degrees in ((359.9, 0.1, 180.0, 0.0, 725.0), (0.1, 359.9, -180.0, 180.0, 5.0))
    )
    found = camera_errors.angle_difference_deg(first, second)
    return case.close(found, [0.2, 0.2, 0.0, 180.0, 0.0], 1e3 * case.step(dtype))


@CAMERAS.case(
    "cameras that are not cameras",
    "an azimuth of NaN, a radius of inf and of -1, an image of 0 pixels",
    "refused, naming the rule",
)
def _refused(dtype: torch.dtype) -> case.Outcome:
    field = constant_field((AHEAD, AHEAD, 0, 20), dtype)
    shape = shape_field.ShapeField(field, -np.ones(3), np.ones(3), transforms.Similarity(), {})
    return case.worst(
        case.refused(lambda: framed_field.render(shape, (math.nan, 0.0, 1.0), 4), "camera must be finite; got nan"),
        case.refused(lambda: framed_field.render(shape, (0.0, 0.0, math.inf), 4), "camera must be finite; got inf"),
        case.refused(lambda: framed_field.render(shape, (0.0, 0.0, 1.0), 0), "size must be >= 1"),
        case.refused(lambda: framed_field.render(shape, (0.0, 0.0, -1.0), 4), "camera radius >= 0"),
    )

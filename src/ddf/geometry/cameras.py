"""The cameras of the 3D-R2N2 renders: extrinsics, projection and pixel rays in the benchmark frame.

Letters: θ azimuth and φ elevation in radians, r radius in benchmark units (R2N2's "ratio"), u to the right and v
down in pixels of a 137 x 137 image (pixel-edge convention: the first pixel's centre is at 0.5). The camera looks at
the origin along -Z of its own frame. Facts checked against the renders: docs/formats.md.
"""

import math
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor

IMAGE_SIZE = 137
FOCAL_PX = 149.84375  # 35 mm lens, 32 mm sensor, 137 pixels
CENTRE_PX = 68.5
Mirror = Literal["x", "z"]  # normal axis of a plane of the benchmark frame that holds the up axis


def mirrored(camera: Float[Tensor, "*batch 3"], mirror: Mirror) -> Float[Tensor, "*batch 3"]:
    """The camera that sees the mirror image of a shape, about a plane through the origin, as the flipped image.

    Derived here: θ becomes -θ (normal z) or π - θ (normal x), in [0, 2π); φ and r stay.
    """
    azimuth = (-camera[..., :1] if mirror == "z" else math.pi - camera[..., :1]).remainder(2 * math.pi)
    return torch.cat((azimuth, camera[..., 1:]), dim=-1)


def between(one: Float[Tensor, "*batch 3"], other: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
    """Means of two cameras' numbers; of the azimuths that on the shorter way round, in [0, 2π)."""
    azimuths = torch.stack((one[..., :1], other[..., :1]))
    azimuth = torch.atan2(torch.sin(azimuths).sum(0), torch.cos(azimuths).sum(0)).remainder(2 * math.pi)
    return torch.cat((azimuth, (one[..., 1:] + other[..., 1:]) / 2), dim=-1)


def position(
    azimuth_rad: Float[Tensor, "*batch"], elevation_rad: Float[Tensor, "*batch"], radius: Float[Tensor, "*batch"]
) -> Float[Tensor, "*batch 3"]:
    """Camera centre r (cos φ cos θ, sin φ, cos φ sin θ), benchmark frame."""
    horizontal = torch.cos(elevation_rad)
    direction = (horizontal * torch.cos(azimuth_rad), torch.sin(elevation_rad), horizontal * torch.sin(azimuth_rad))
    return radius[..., None] * torch.stack(direction, dim=-1)


def rotation(
    azimuth_rad: Float[Tensor, "*batch"], elevation_rad: Float[Tensor, "*batch"]
) -> Float[Tensor, "*batch 3 3"]:
    """World to camera: rows X (right), Y (up), Z (backwards), with Z = unit(cam), X = unit((0,1,0) x Z), Y = Z x X.

    X = (sin θ, 0, -cos θ) is that unit vector in closed form (derived here), so elevations of ±90 degrees are no
    special case: the azimuth then fixes the roll.
    """
    sin_t, cos_t = torch.sin(azimuth_rad), torch.cos(azimuth_rad)
    sin_p, cos_p = torch.sin(elevation_rad), torch.cos(elevation_rad)
    zero = torch.zeros_like(sin_t)
    right = torch.stack((sin_t, zero, -cos_t), dim=-1)
    up = torch.stack((-sin_p * cos_t, cos_p, -sin_p * sin_t), dim=-1)
    backwards = torch.stack((cos_p * cos_t, sin_p, cos_p * sin_t), dim=-1)
    return torch.stack((right, up, backwards), dim=-2)


def extrinsics(
    azimuth_rad: Float[Tensor, "*batch"], elevation_rad: Float[Tensor, "*batch"], radius: Float[Tensor, "*batch"]
) -> tuple[Float[Tensor, "*batch 3 3"], Float[Tensor, "*batch 3"]]:
    """Rotation R and centre cam, with p_cam = R (x - cam) for x in the benchmark frame; differentiable."""
    return rotation(azimuth_rad, elevation_rad), position(azimuth_rad, elevation_rad, radius)


def to_camera(
    points: Float[Tensor, "*batch n 3"], world_to_camera: Float[Tensor, "*batch 3 3"], centre: Float[Tensor, "*batch 3"]
) -> Float[Tensor, "*batch n 3"]:
    """p_cam = R (x - cam)."""
    return (points - centre[..., None, :]) @ world_to_camera.transpose(-1, -2)


def project(
    points: Float[Tensor, "*batch n 3"], world_to_camera: Float[Tensor, "*batch 3 3"], centre: Float[Tensor, "*batch 3"]
) -> tuple[Float[Tensor, "*batch n"], Float[Tensor, "*batch n"]]:
    """Pixel coordinates u = f X/(-Z) + c, v = f Y/Z + c in the 137-pixel image; meaningless behind it (Z >= 0)."""
    x, y, z = to_camera(points, world_to_camera, centre).unbind(-1)
    return FOCAL_PX * x / -z + CENTRE_PX, FOCAL_PX * y / z + CENTRE_PX


def pixel_directions(size: int, dtype: torch.dtype = torch.float32) -> Float[Tensor, "size size 3"]:
    """Unit directions through the pixel centres of a size x size image, camera frame, rows from the top."""
    centres = (torch.arange(size, dtype=dtype) + 0.5) * (IMAGE_SIZE / size)
    offset = (centres - CENTRE_PX) / FOCAL_PX
    y, x = torch.meshgrid(-offset, offset, indexing="ij")
    return torch.nn.functional.normalize(torch.stack((x, y, -torch.ones_like(x)), dim=-1), dim=-1)


def pixel_rays(
    azimuth_rad: Float[Tensor, "*batch"],
    elevation_rad: Float[Tensor, "*batch"],
    radius: Float[Tensor, "*batch"],
    directions: Float[Tensor, "*#batch n 3"],
) -> tuple[Float[Tensor, "*batch 3"], Float[Tensor, "*batch n 3"]]:
    """Camera centres and world directions (benchmark frame) of chosen pixels; differentiable.

    Args:
      directions: camera-frame unit directions, as of `pixel_directions`: any subset, the same for all cameras (n, 3) or
        each camera's own (*batch, n, 3).
    """
    world_to_camera, centre = extrinsics(azimuth_rad, elevation_rad, radius)
    return centre, directions.to(world_to_camera) @ world_to_camera


def degrees_to_radians(camera: Float[Tensor, "*batch 3"]) -> Float[Tensor, "*batch 3"]:
    """(azimuth, elevation, radius) from the metadata's degrees to radians; the radius stays."""
    return camera * camera.new_tensor([math.pi / 180, math.pi / 180, 1.0])

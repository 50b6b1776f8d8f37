"""The cameras of the 3D-R2N2 renders: extrinsics, projection and pixel rays in the benchmark frame.

Letters: θ azimuth and φ elevation in radians, r radius in benchmark units (R2N2's "ratio"), u to the right and v
down in pixels of a 137 x 137 image (pixel-edge convention: the first pixel's centre is at 0.5). The camera looks at
the origin along -Z of its own frame. Numpy arrays and torch tensors alike; for tensors everything is differentiable.
"""

import math

import numpy as np
from jaxtyping import Float

from ddf.core import arrays
from ddf.core.arrays import Array

IMAGE_SIZE = 137
FOCAL_PX = 149.84375  # 35 mm lens, 32 mm sensor, 137 pixels
CENTRE_PX = 68.5


def position(
    azimuth_rad: Float[Array, "*batch"], elevation_rad: Float[Array, "*batch"], radius: Float[Array, "*batch"]
) -> Float[Array, "*batch 3"]:
    """Camera centre r (cos φ cos θ, sin φ, cos φ sin θ), benchmark frame."""
    xp = arrays.namespace(radius)
    horizontal = xp.cos(elevation_rad)
    direction = (horizontal * xp.cos(azimuth_rad), xp.sin(elevation_rad), horizontal * xp.sin(azimuth_rad))
    return radius[..., None] * xp.stack(direction, -1)


def rotation(azimuth_rad: Float[Array, "*batch"], elevation_rad: Float[Array, "*batch"]) -> Float[Array, "*batch 3 3"]:
    """World to camera: rows X (right), Y (up), Z (backwards), with Z = unit(cam), X = unit((0,1,0) x Z), Y = Z x X.

    X = (sin θ, 0, -cos θ) is that unit vector in closed form (derived here), so elevations of ±90 degrees are no
    special case: the azimuth then fixes the roll.
    """
    xp = arrays.namespace(azimuth_rad)
    sin_t, cos_t = xp.sin(azimuth_rad), xp.cos(azimuth_rad)
    sin_p, cos_p = xp.sin(elevation_rad), xp.cos(elevation_rad)
    zero = xp.zeros_like(sin_t)
    right = xp.stack((sin_t, zero, -cos_t), -1)
    up = xp.stack((-sin_p * cos_t, cos_p, -sin_p * sin_t), -1)
    backwards = xp.stack((cos_p * cos_t, sin_p, cos_p * sin_t), -1)
    return xp.stack((right, up, backwards), -2)


def extrinsics(
    azimuth_rad: Float[Array, "*batch"], elevation_rad: Float[Array, "*batch"], radius: Float[Array, "*batch"]
) -> tuple[Float[Array, "*batch 3 3"], Float[Array, "*batch 3"]]:
    """Rotation R and centre cam, with p_cam = R (x - cam) for x in the benchmark frame; differentiable."""
    return rotation(azimuth_rad, elevation_rad), position(azimuth_rad, elevation_rad, radius)


def to_camera(
    points: Float[Array, "*batch n 3"], world_to_camera: Float[Array, "*batch 3 3"], centre: Float[Array, "*batch 3"]
) -> Float[Array, "*batch n 3"]:
    """p_cam = R (x - cam)."""
    return (points - centre[..., None, :]) @ world_to_camera.swapaxes(-1, -2)


def moved(
    points: Float[Array, "*batch n 3"],
    extrinsics_from: tuple[Float[Array, "*batch 3 3"], Float[Array, "*batch 3"]],
    extrinsics_to: tuple[Float[Array, "*batch 3 3"], Float[Array, "*batch 3"]],
) -> Float[Array, "*batch n 3"]:
    """The points that one camera sees where another saw the given ones; benchmark frame."""
    rotation, centre = extrinsics_to
    return to_camera(points, *extrinsics_from) @ rotation + centre[..., None, :]


def project(
    points: Float[Array, "*batch n 3"], world_to_camera: Float[Array, "*batch 3 3"], centre: Float[Array, "*batch 3"]
) -> tuple[Float[Array, "*batch n"], Float[Array, "*batch n"]]:
    """Pixel coordinates u = f X/(-Z) + c, v = f Y/Z + c in the 137-pixel image; meaningless behind it (Z >= 0)."""
    seen = to_camera(points, world_to_camera, centre)
    x, y, z = seen[..., 0], seen[..., 1], seen[..., 2]
    return FOCAL_PX * x / -z + CENTRE_PX, FOCAL_PX * y / z + CENTRE_PX


def pixel_directions(size: int, like: Array) -> Float[Array, "size size 3"]:
    """Unit directions through the pixel centres of a size x size image, camera frame, rows from the top, in the
    library and type of `like`, such as the camera.
    """
    xp = arrays.namespace(like)
    centres = (xp.arange(size, dtype=like.dtype, device=like.device) + 0.5) * (IMAGE_SIZE / size)
    v, u = xp.meshgrid(centres, centres, indexing="ij")
    return arrays.like(directions_at(u, v), like)


def directions_at(u: Float[Array, "*batch"], v: Float[Array, "*batch"]) -> Float[Array, "*batch 3"]:
    """Unit directions through pixel coordinates of the 137-pixel image, camera frame: the inverse of `project`."""
    xp = arrays.namespace(u)
    directions = xp.stack(((u - CENTRE_PX) / FOCAL_PX, -((v - CENTRE_PX) / FOCAL_PX), -xp.ones_like(u)), -1)
    return directions / xp.linalg.vector_norm(directions, axis=-1, keepdims=True)


def pixel_rays(
    azimuth_rad: Float[Array, "*batch"],
    elevation_rad: Float[Array, "*batch"],
    radius: Float[Array, "*batch"],
    directions: Float[Array, "*#batch n 3"],
) -> tuple[Float[Array, "*batch 3"], Float[Array, "*batch n 3"]]:
    """Camera centres and world directions (benchmark frame) of chosen pixels; differentiable. Directions are of the
    camera's frame, as of `pixel_directions`: any subset, the same for all cameras or (*batch, n, 3).
    """
    world_to_camera, centre = extrinsics(azimuth_rad, elevation_rad, radius)
    return centre, arrays.like(directions, world_to_camera) @ world_to_camera


def mirrored(camera: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3"]:
    """The camera that sees the mirror image in z = 0 as `camera` sees the shape, left for right: -θ, in [0, 2π)."""
    xp = arrays.namespace(camera)
    return xp.concat((-camera[..., :1] % (2 * math.pi), camera[..., 1:]), -1)


def degrees_to_radians(camera: Float[Array, "*batch 3"]) -> Float[Array, "*batch 3"]:
    """(azimuth, elevation, radius) from the metadata's degrees to radians; the radius stays."""
    return camera * arrays.like(np.array([math.pi / 180, math.pi / 180, 1.0]), camera)

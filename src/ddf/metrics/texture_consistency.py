"""Whether colours stay on the surface when the camera moves: a point's colour in two images, by the surface's depth.

A pixel of one image is a surface point q; where q projects into the other image, and is not hidden there, both images
show the same point. The error is the mean absolute difference of their colours in [0, 1]. Derived here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.geometry import cameras

HIDDEN = 0.02  # benchmark units: a surface this much nearer hides a point; depth steps are smaller on 64 pixels


@dataclass(frozen=True)
class Picture:
    """An image in [0, 1], its camera (benchmark frame), and distance along each pixel's ray, `inf` off the surface."""

    camera: Float[Tensor, "3"]
    distance: Float[Tensor, "h w"]
    colours: Float[Tensor, "3 h w"]


def differences(first: Picture, second: Picture) -> Float[Tensor, "k"]:
    """|colour in the first - colour in the second|, mean of the channels, of each point of the first that both see."""
    size = first.distance.shape[0]
    directions = cameras.pixel_directions(size, first.camera).reshape(-1, 3)
    centre, world = cameras.pixel_rays(first.camera[0], first.camera[1], first.camera[2], directions)
    distance = first.distance.reshape(-1)
    seen = distance.isfinite()
    points = centre + distance[seen, None] * world[seen]
    angles, radius = second.camera[:2], second.camera[2]
    rotation, other = cameras.extrinsics(angles[0], angles[1], radius)
    column, row = cameras.project(points, rotation, other)
    place = 2 * torch.stack((column, row), dim=-1) / cameras.IMAGE_SIZE - 1  # of grid_sample, edges of pixels at ±1
    inside = (place.abs() < 1).all(dim=-1)
    nearest = functional.grid_sample(
        second.distance[None, None], place[None, None], mode="nearest", align_corners=False
    )[0, 0, 0]
    both = inside & ((points - other).norm(dim=-1) - nearest < HIDDEN) & nearest.isfinite()
    found = functional.grid_sample(
        second.colours[None], place[None, None, both], mode="bilinear", align_corners=False, padding_mode="border"
    )[0, :, 0]
    own = first.colours.reshape(3, -1)[:, seen][:, both]
    return (own - found).abs().mean(dim=0)


def error(pairs: Sequence[tuple[Picture, Picture]]) -> tuple[float, int]:
    """Mean over all points of all pairs, and their number; NaN where no pair shows a common point."""
    found = torch.cat([differences(first, second) for first, second in pairs])
    return float(found.double().mean()), len(found)

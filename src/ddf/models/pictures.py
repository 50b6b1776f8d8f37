"""What a latent looks like: normals, depth and, of an image GAN, colours, from chosen cameras."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.fields import pddf
from ddf.models import image_gans, normal_images, shape_vae

AZIMUTH_DEG = 45.0  # of the first camera of every picture
ELEVATION_DEG, RADIUS = 27.5, 0.8  # of the cameras of `ddf generate`; the middle of 3D-R2N2's


def on_white(normals: Float[Tensor, "*n 3 h w"]) -> Float[Tensor, "*n 3 h w"]:
    """(n + 1)/2 as colours, white where nothing is seen."""
    return torch.where(normals.ne(0).any(dim=-3, keepdim=True), (normals + 1) / 2, 1.0)


@dataclass(frozen=True)
class Seen:
    """One shape from one camera: normals in [-1, 1], depth in field units, colours in [0, 1] of each texture."""

    camera: Float[Tensor, "3"]
    normals: Float[Tensor, "3 h w"]
    depth: Float[Tensor, "h w"]
    colours: Float[Tensor, "textures 3 h w"]


def cameras_around(count: int, elevation_deg: float, radius: float) -> list[Float[Tensor, "3"]]:
    """Cameras at equal distances on a circle, as (azimuth, elevation, radius)."""
    turns = [math.radians(AZIMUTH_DEG + 360 * i / count) for i in range(count)]
    return [torch.tensor([turn, math.radians(elevation_deg), radius]) for turn in turns]


@torch.no_grad()
def look(
    model: image_gans.ImageGAN, field: pddf.PDDF, camera: Float[Tensor, "3"], textures: Float[Tensor, "textures z"]
) -> Seen:
    """A shape with each of some textures: its normals are rendered once."""
    normals, depth = normal_images.render(field, model.field_scale, camera)
    images = normals.expand(len(textures), -1, -1, -1)
    colours = model.colours(images, textures.to(normals)) if len(textures) else images
    return Seen(camera, normals, depth, (colours + 1) / 2)


def fields(decoder: pddf.ConditionalPDDF, latents: Float[Tensor, "n z"]) -> list[pddf.PDDF]:
    """The shape of each latent."""
    place = decoder.field.network.head.weight.device
    return [shape_vae.plain_field(decoder, latent.to(place)) for latent in latents]


def between(ends: Sequence[Float[Tensor, "z"]], count: int) -> Float[Tensor, "count z"]:
    """Latents from the first of two to the second, along the great circle: all of them as likely as N(0, I) has it.

    Their lengths go evenly from one to the other; straight lines would pass nearer to 0 than any sample does.
    """
    first, last = (end / end.norm() for end in ends)
    angle = torch.acos((first * last).sum().clamp(-1, 1))
    shares = torch.linspace(0, 1, count)[:, None]
    if float(angle.sin()) < 1e-4:
        turned = torch.lerp(first, last, shares)
    else:
        turned = (torch.sin((1 - shares) * angle) * first + torch.sin(shares * angle) * last) / angle.sin()
    return turned * torch.lerp(ends[0].norm(), ends[1].norm(), shares)

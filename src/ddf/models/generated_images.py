"""Images of latents: normals, depth and, of an image GAN, colours. [DDF22] §4.4.

Stage `normals` renders I_n(z_s, Π) ahead, by the frozen field, into shards: z_s ~ N(0, I), Π on the part of the upper
hemisphere that the config names. A shard `NNN.safetensors` has `normals` int8 (n, 3, 64, 64) (n x 127, 0 where nothing
is seen), `latents` float32 (n, z), `cameras` float32 (n, 3). Normals have the axes of the shape, not of the camera, so
that a part of the surface looks the same from everywhere.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int8
from torch import Tensor

from ddf.core import parallel, seeding, storage
from ddf.data.batches import category_data
from ddf.fields import framed_field, pddf, rendering
from ddf.models import generative_models, generative_settings, image_networks

SUFFIX = ".safetensors"
LEVELS = 127  # of a component of a normal
AZIMUTH_DEG = 45.0  # of the first camera of every picture
ELEVATION_DEG, RADIUS = 27.5, 0.8  # of the cameras of `ddf generate`; the middle of 3D-R2N2's


def latents(count: int, features: int, seed: int, purpose: str) -> Float[Tensor, "count features"]:
    """N(0, I); the first of many are those of few."""
    random = seeding.generator(seed, purpose)
    return torch.from_numpy(random.standard_normal((count, features)).astype(np.float32))


def random_camera(config: generative_settings.NormalsConfig, random: np.random.Generator) -> Float[Tensor, "3"]:
    """Azimuth and elevation in radians, spread evenly over a part of the sphere, and the radius."""
    low, high = (math.sin(math.radians(angle)) for angle in config.elevation_deg)
    azimuth, elevation = random.uniform(0, 2 * math.pi), math.asin(random.uniform(low, high))
    return torch.tensor([azimuth, elevation, config.radius], dtype=torch.float32)


def render(
    field: pddf.PDDF, field_scale: Float[Tensor, ""], camera: Float[Tensor, "3"], size: int = image_networks.IMAGE_SIZE
) -> tuple[Float[Tensor, "3 size size"], Float[Tensor, "size size"]]:
    """Normals, 0 where nothing is seen, and depth in field units, `inf` there, of one plain field."""
    found, _ = rendering.render(field, None, camera.to(field_scale), field_scale, size)
    seen = found["visibility"] >= framed_field.SEEN
    normals = torch.where(seen[..., None], found["normals"], 0.0)
    return normals.permute(2, 0, 1), torch.where(seen, found["depth"], torch.inf)


def render_shard(
    config: generative_settings.NormalsConfig, vae: Path, numbers: Sequence[int], shard: parallel.Shard
) -> parallel.ShardResult:
    """Map over numbers of images: writes `NNN.safetensors`."""
    torch.set_num_threads(1)
    model = generative_models.load_vae(vae)
    shapes, poses, images = [], [], []
    for number in numbers:
        random = seeding.generator(config.seed, "normals", str(number))
        latent = torch.from_numpy(random.standard_normal(model.config.latent_features).astype(np.float32))
        camera = random_camera(config, random)
        field = generative_models.plain_field(model.decoder, latent.to(model.field_scale.device))
        normals, _ = render(field, model.field_scale, camera)
        images.append((normals * LEVELS).round().to(torch.int8).cpu())
        shapes.append(latent)
        poses.append(camera)
    path = shard.file(SUFFIX)
    tensors = {"normals": torch.stack(images), "latents": torch.stack(shapes), "cameras": torch.stack(poses)}
    storage.save_tensors(path, tensors, {"fingerprint": shard.fingerprint, "seed": config.seed})
    return parallel.ShardResult([path])


def read_normals(folder: Path) -> tuple[Int8[Tensor, "n 3 h w"], list[Path]]:
    """All images of a folder that stage `normals` wrote, n x `LEVELS`, and their files, each verified."""
    paths = storage.shard_files(folder, SUFFIX, "normals")
    shards = [storage.load_tensors(path, framework="torch")[0]["normals"] for path in paths]
    images, start = category_data.mapped((sum(map(len, shards)), *shards[0].shape[1:]), np.int8), 0
    for shard in shards:
        images[start : start + len(shard)] = shard
        start += len(shard)
    return images, paths


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
    model: generative_models.ImageGAN,
    field: pddf.PDDF,
    camera: Float[Tensor, "3"],
    textures: Float[Tensor, "textures z"],
) -> Seen:
    """A shape with each of some textures: its normals are rendered once."""
    normals, depth = render(field, model.field_scale, camera)
    images = normals.expand(len(textures), -1, -1, -1)
    colours = model.colours(images, textures.to(normals)) if len(textures) else images
    return Seen(camera, normals, depth, (colours + 1) / 2)


def fields(decoder: pddf.ConditionalPDDF, latents: Float[Tensor, "n z"]) -> list[pddf.PDDF]:
    """The shape of each latent."""
    place = decoder.field.network.head.weight.device
    return [generative_models.plain_field(decoder, latent.to(place)) for latent in latents]


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

"""Normals of random shapes from random cameras, rendered ahead by the frozen field into shards. [DDF22] §4.4.

I_n(z_s, Π): z_s ~ N(0, I), Π on the part of the upper hemisphere that the config names. A shard `NNN.safetensors` has
`normals` int8 (n, 3, 64, 64) (n x 127, 0 where nothing is seen), `latents` float32 (n, z), `cameras` float32 (n, 3).
Normals have the axes of the shape, not of the camera, so that a part of the surface looks the same from everywhere.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.core import parallel, seeding, storage
from ddf.data.batches import category_data
from ddf.fields import framed_field, pddf, rendering
from ddf.models import generative_settings, image_networks, shape_vae

SUFFIX = ".safetensors"
LEVELS = 127  # of a component of a normal


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
    model = shape_vae.load(vae)
    shapes, poses, images = [], [], []
    for number in numbers:
        random = seeding.generator(config.seed, "normals", str(number))
        latent = torch.from_numpy(random.standard_normal(model.config.latent_features).astype(np.float32))
        camera = random_camera(config, random)
        field = shape_vae.plain_field(model.decoder, latent.to(model.field_scale.device))
        normals, _ = render(field, model.field_scale, camera)
        images.append((normals * LEVELS).round().to(torch.int8).cpu())
        shapes.append(latent)
        poses.append(camera)
    path = shard.file(SUFFIX)
    tensors = {"normals": torch.stack(images), "latents": torch.stack(shapes), "cameras": torch.stack(poses)}
    storage.save_tensors(path, tensors, {"fingerprint": shard.fingerprint, "seed": config.seed})
    return parallel.ShardResult([path])


@dataclass(frozen=True)
class NormalSet:
    """Normals rendered ahead; shards are mapped a few at a time. places: shard and row of each image."""

    shards: category_data.Numbered[Mapping[str, np.ndarray]]
    places: Sequence[tuple[int, int]]

    def __len__(self) -> int:
        return len(self.places)

    def batch(self, rows: Int[np.ndarray, "b"]) -> Float[Tensor, "b 3 h w"]:
        """Normals in [-1, 1]."""
        found = [self.shards[number]["normals"][row] for number, row in (self.places[i] for i in rows.tolist())]
        return torch.from_numpy(np.stack(found)).float() / LEVELS


def read(folder: Path) -> tuple[NormalSet, list[Path]]:
    """All images of a folder that stage `normals` wrote, and their files, each verified."""
    paths = storage.shard_files(folder, SUFFIX, "normals")
    counts = [len(storage.load_tensors(path)[0]["latents"]) for path in paths]
    places = [(number, row) for number, count in enumerate(counts) for row in range(count)]
    return NormalSet(category_data.MappedShards(paths), places), paths

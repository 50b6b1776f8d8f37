"""The pictures of the page on generative models, as arrays: samples, one shape all round, interpolations, rivals."""

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.data.batches import category_data
from ddf.models import generated_images, generative_models, generative_settings
from ddf.training import generative_steps
from ddf_lab.evaluation.generative import generative_images

GRID = 5  # shapes and textures of the interpolation


@torch.no_grad()
def draw(
    model: generative_models.ImageGAN,
    rival: generative_models.NoiseGAN,
    images: category_data.ImageSet,
    sampled: category_data.ImageSet,
    nearest: list[str],
    section: generative_settings.ScoresConfig,
) -> dict[str, Float[Tensor, "_ 3 h w"]]:
    """Images by the name of their picture: normals in [-1, 1], colours in [0, 1].

    Args:
      images: what the critic saw. sampled: renders of the VAE's shapes. nearest: id of the learned shape nearest to
        each of the prior's samples.
    """
    latents = generated_images.latents(section.samples, model.vae.latent_features, section.seed, "samples")
    textures = generated_images.latents(section.samples, model.config.texture_features, section.seed, "textures")
    gan = model.config.normals
    around = generated_images.cameras_around(section.cameras, sum(gan.elevation_deg) / 2, gan.radius)
    fields = generated_images.fields(model.decoder, latents)
    samples = [generated_images.look(model, f, around[0], t[None]) for f, t in zip(fields, textures, strict=True)]
    views = [generated_images.look(model, fields[0], camera, textures[:1]) for camera in around]
    shapes = generated_images.fields(model.decoder, generated_images.between((latents[0], latents[1]), GRID))
    between = generated_images.between((textures[0], textures[1]), GRID)
    grid = [generated_images.look(model, field, around[0], between) for field in shapes]
    rows = [next(i for i, shape in enumerate(sampled.shapes) if sampled.ids[shape] == name) for name in nearest]
    real = torch.stack(
        [images.images[row] for row in range(0, len(images.shapes), len(images.shapes) // section.samples)]
    )
    found = {
        "samples_normals": torch.stack([seen.normals for seen in samples]),
        "samples_colours": torch.stack([seen.colours[0] for seen in samples]),
        "samples_nearest": _colours(torch.stack([sampled.images[row] for row in rows])),
        "views_normals": torch.stack([seen.normals for seen in views]),
        "views_colours": torch.stack([seen.colours[0] for seen in views]),
        "grid_normals": torch.stack([seen.normals for seen in grid]),
        "grid_colours": torch.cat([seen.colours for seen in grid]),
        "rival_colours": (generative_images.generated_2d(rival, section.samples, section.seed) + 1) / 2,
        "real_colours": _colours(real[: section.samples]),
    }
    return {name: values.cpu() for name, values in found.items()}


def _colours(images: Tensor) -> Float[Tensor, "n 3 h w"]:
    """RGBA bytes over white, in [0, 1]."""
    return (generative_steps.on_white(images.float() / 255) + 1) / 2

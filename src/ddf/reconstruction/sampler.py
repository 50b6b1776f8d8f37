"""New shapes of any model that decodes latents: a shape VAE, an image GAN, or a reconstruction model.

The first two learned with N(0, I) as their prior. Latents of the third are normal about those of its training images
(`latent_prior`): its coordinates, N(0, I) too, stand for them here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import checks, storage
from ddf.fields import cloud_projection, model_files, shape_field
from ddf.fit import latent_prior
from ddf.models import generative_models
from ddf.reconstruction import many_images, mask_descent, one_image


@dataclass(frozen=True)
class Sampler:
    """features: of a latent, which is N(0, I). decode: its shape, frame of v1. images: what paints it, if anything."""

    features: int
    decode: Callable[[Float[Tensor, "z"]], shape_field.ShapeField]
    images: generative_models.ImageGAN | None = None


def load(folder: Path) -> Sampler:
    """Of a model's folder; InputError where it decodes no latents."""
    kind = storage.load_metadata(folder / model_files.MODEL).get("kind")
    if kind == "ddf" or (folder / latent_prior.SHAPES).exists():
        return _of_reconstruction(folder)
    if kind not in (generative_models.VAE, generative_models.GAN):
        raise checks.InputError(
            f"{folder}: no shape VAE, image GAN or reconstruction model; give chair, plane or car, or a folder that "
            "stage train_gan, train_vae or train_ddf wrote"
        )
    model = generative_models.load_gan(folder) if kind == generative_models.GAN else generative_models.load_vae(folder)

    def decode(latent: Float[Tensor, "z"]) -> shape_field.ShapeField:
        field = generative_models.plain_field(model.decoder, latent.to(model.field_scale))
        return shape_field.in_cube(field, 1 / float(model.field_scale))

    features = model.decoder.modulator.layers[0].in_features
    return Sampler(features, decode, model if isinstance(model, generative_models.ImageGAN) else None)


def _of_reconstruction(folder: Path) -> Sampler:
    decoder, prior, _ = latent_prior.load(folder)

    def decode(latent: Float[Tensor, "z"]) -> shape_field.ShapeField:
        modulations = [each[0] for each in decoder.modulations(prior.latents(latent)[None])]
        drawn, generator = cloud_projection.USUAL, torch.Generator().manual_seed(0)
        cloud = cloud_projection.draw(decoder.field, modulations, many_images.ROUGH_POINTS, drawn, generator)
        return one_image.placed(decoder.field, modulations, cloud, mask_descent.scale_from_cloud(cloud))

    return Sampler(prior.basis.shape[1], decode)

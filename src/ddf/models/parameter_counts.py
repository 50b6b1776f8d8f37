"""Exact numbers of parameters of all networks of a generative experiment, built without memory for their values."""

import torch
from torch import nn

from ddf.fields import pddf
from ddf.models import generative_settings, image_gans, shape_vae


def models(vae: generative_settings.VAEConfig, gan: generative_settings.GANConfig) -> dict[str, nn.Module]:
    """The networks by name, on the device `meta`."""
    with torch.device("meta"):
        shape, image, flat = shape_vae.ShapeVAE(vae), image_gans.ImageGAN(vae, gan), image_gans.NoiseGAN(gan)
    return {
        "point_encoder": shape.posterior.encoder,
        "posterior_heads": nn.ModuleList((shape.posterior.mean, shape.posterior.log_variance)),
        "decoder": shape.decoder,
        "decoder_field": shape.decoder.field,
        "decoder_modulator": shape.decoder.modulator,
        "colours_from_normals": image.colours,
        "normals_from_colours": image.normals,
        "texture_encoder": image.textures,
        "critic": image.critic,
        "generator_2d": flat.generator,
    }


def count(vae: generative_settings.VAEConfig, gan: generative_settings.GANConfig) -> dict[str, int]:
    """Parameters of each of `models`."""
    return {name: pddf.count_parameters(model) for name, model in models(vae, gan).items()}

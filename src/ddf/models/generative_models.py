"""Generative models: the shape VAE, the image GAN, and the 2D GAN that is compared with it. [DDF22] §4.4.

The VAE takes points with normals to a latent by PointNet (Qi et al. 2017), whose widths are shares of the paper's, and
a latent to a directed distance field. Of one latent the decoder's modulations are constants, which fold into the
weights (`plain_field`): what reads a field of one shape reads a sample of the VAE. The image GAN has the VAE's decoder
in it, frozen, so that its file alone makes images: latent, field, normals, colours.
"""

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.core import checks, config, storage
from ddf.fields import model_files, pddf
from ddf.models import generative_settings, image_networks

VAE, GAN, GAN_2D = "vae", "image_gan", "image_gan_2d"  # kinds of the files' records
BETAS = (0.0, 0.9)  # of the GANs' Adam


POINT_WIDTHS = (64, 64, 128, 1024)  # of the layers that see every point by itself
CLOUD_WIDTHS = (512, 512)  # of those that see their largest values
DROPOUT = 0.1
POINT_FEATURES = 6  # position and normal


class PointEncoder(nn.Module):
    """Points with normals to features of the cloud, whatever the order of the points; no point transformers.

    width: of the first layer; 64 is the paper's, the others keep their ratio to it. Dropout is in front of the last
    layer, as in PointNet's classifier; the paper gives its probability alone.
    """

    def __init__(self, out_features: int, width: int = POINT_WIDTHS[0]) -> None:
        super().__init__()
        per_point = [POINT_FEATURES, *(share * width // POINT_WIDTHS[0] for share in POINT_WIDTHS)]
        of_cloud = [per_point[-1], *(share * width // POINT_WIDTHS[0] for share in CLOUD_WIDTHS)]

        def normalised(layer: nn.Module, width: int) -> nn.Sequential:
            return nn.Sequential(layer, nn.BatchNorm1d(width), nn.ReLU(inplace=True))

        points = (normalised(nn.Conv1d(a, b, kernel_size=1), b) for a, b in itertools.pairwise(per_point))
        self.points = nn.Sequential(*points)
        cloud = (normalised(nn.Linear(a, b), b) for a, b in itertools.pairwise(of_cloud))
        self.cloud = nn.Sequential(*cloud, nn.Dropout(DROPOUT), nn.Linear(of_cloud[-1], out_features))

    def forward(
        self, positions: Float[Tensor, "b n 3"], normals: Float[Tensor, "b n 3"]
    ) -> Float[Tensor, "b features"]:
        """Features of clouds of the field frame."""
        joined = nn.functional.pad(positions, (0, 3)) + nn.functional.pad(normals, (3, 0))
        return self.cloud(self.points(joined.transpose(1, 2)).amax(dim=-1))


class Posterior(nn.Module):
    """q(z_s | P, N): mean and logarithm of the variance of a normal distribution, one network for each half."""

    def __init__(self, latent_features: int, width: int = POINT_WIDTHS[0]) -> None:
        super().__init__()
        self.encoder = PointEncoder(2 * latent_features, width)
        self.mean, self.log_variance = (
            nn.Sequential(
                nn.Linear(latent_features, latent_features),
                nn.ReLU(inplace=True),
                nn.Linear(latent_features, latent_features),
            )
            for _ in range(2)
        )

    def forward(
        self, positions: Float[Tensor, "b n 3"], normals: Float[Tensor, "b n 3"]
    ) -> tuple[Float[Tensor, "b z"], Float[Tensor, "b z"]]:
        """Mean and log-variance of z_s."""
        first, second = self.encoder(positions, normals).chunk(2, dim=-1)
        return self.mean(first), self.log_variance(second)


def divergence(mean: Float[Tensor, "b z"], log_variance: Float[Tensor, "b z"]) -> Float[Tensor, "b z"]:
    """KL(q ‖ N(0, I)) of every dimension, nats: (μ² + σ² - ln σ² - 1)/2. Source: Kingma and Welling 2014, app. B."""
    return 0.5 * (mean.square() + log_variance.exp() - log_variance - 1)


class ShapeVAE(nn.Module):
    """E and its heads, and the conditional PDDF that decodes.

    field_scale: field units per v1 unit, the mean over the shapes that were learned: what a sample of the prior, which
    no mesh has given a size, is drawn at.
    """

    field_scale: Float[Tensor, ""]

    def __init__(self, config: generative_settings.VAEConfig) -> None:
        super().__init__()
        self.config = config
        self.posterior = Posterior(config.latent_features, config.encoder_width)
        self.decoder = pddf.ConditionalPDDF(config.field, config.latent_features)
        self.register_buffer("field_scale", torch.ones(()))

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Of the optimiser: Adam's, without decay; the encoder's learning rate as a share of the decoder's."""
        own = self.config.encoder_learning_rate
        share = 1.0 if own is None else own / self.config.loop.learning_rate
        return [
            {"params": list(self.decoder.parameters()), "weight_decay": 0.0},
            {"params": list(self.posterior.parameters()), "weight_decay": 0.0, "share": share},
        ]


def plain_field(decoder: pddf.ConditionalPDDF, latent: Float[Tensor, "z"]) -> pddf.PDDF:
    """The field of one latent without a modulator."""
    return pddf.baked(decoder.field, decoder.modulator(latent))


class ImageGAN(nn.Module):
    """f_T, its critic D, and g_T and h_T, which say what f_T kept of the normals and of the texture."""

    field_scale: Float[Tensor, ""]

    def __init__(self, vae: generative_settings.VAEConfig, gan: generative_settings.GANConfig) -> None:
        super().__init__()
        self.vae, self.config = vae, gan
        self.decoder = pddf.ConditionalPDDF(vae.field, vae.latent_features).requires_grad_(False)
        self.register_buffer("field_scale", torch.ones(()))
        self.colours = image_networks.Translator(gan.texture_features, gan.translator_width, upsampling=gan.upsampling)
        self.normals = image_networks.Translator(0, gan.translator_width, upsampling=gan.upsampling)
        self.textures = image_networks.TextureEncoder(gan.texture_features, gan.texture_width)
        self.critic = image_networks.Critic(gan.critic_width)

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Of the optimiser: Adam's, without decay; not of the decoder."""
        return _groups(self.colours, self.normals, self.textures, self.critic)


class NoiseGAN(nn.Module):
    """The 2D GAN: the same critic, and a generator that knows no shape."""

    def __init__(self, gan: generative_settings.GANConfig) -> None:
        super().__init__()
        self.config = gan
        self.generator = image_networks.Generator2D(gan.critic_width, gan.noise_features)
        self.critic = image_networks.Critic(gan.critic_width)

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Of the optimiser: Adam's, without decay."""
        return _groups(self.generator, self.critic)


def _groups(*parts: nn.Module) -> list[dict[str, Any]]:
    parameters = [parameter for part in parts for parameter in part.parameters()]
    return [{"params": parameters, "weight_decay": 0.0, "betas": BETAS}]


def parameter_counts(vae: generative_settings.VAEConfig, gan: generative_settings.GANConfig) -> dict[str, int]:
    """Exact numbers of parameters of all networks of an experiment, built without memory for their values."""
    with torch.device("meta"):
        shape, image, flat = ShapeVAE(vae), ImageGAN(vae, gan), NoiseGAN(gan)
    networks = {
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
    return {name: pddf.count_parameters(network) for name, network in networks.items()}


def load_vae(folder: Path) -> ShapeVAE:
    """The VAE of a folder that stage `train_vae` wrote, in evaluation mode."""
    _, (vae,) = recorded(folder, VAE, "train_vae", vae=generative_settings.VAEConfig)
    return model_files.built(lambda: ShapeVAE(vae), folder)


def load_gan(folder: Path) -> ImageGAN:
    """The image GAN of a folder that stage `train_gan` wrote; otherwise like `load_vae`."""
    sections = {"vae": generative_settings.VAEConfig, "gan": generative_settings.GANConfig}
    _, (vae, gan) = recorded(folder, GAN, "train_gan", **sections)
    return model_files.built(lambda: ImageGAN(vae, gan), folder)


def load_gan_2d(folder: Path) -> NoiseGAN:
    """The 2D GAN of a folder that stage `train_gan2d` wrote; otherwise like `load_vae`."""
    _, (gan,) = recorded(folder, GAN_2D, "train_gan2d", gan=generative_settings.GANConfig)
    return model_files.built(lambda: NoiseGAN(gan), folder)


def recorded(folder: Path, kind: str, stage: str, **sections: type) -> tuple[Mapping[str, Any], list[Any]]:
    """The record of a folder's model, and sections of it as the dataclasses that they have today.

    Keys that are gone are passed over: how a network was trained may be said in other words by now. What its layers
    need must be there.

    Args:
      kind: that the record must be of. stage: the one that writes such files. sections: name and class of each.
    """
    record = storage.load_metadata(folder / model_files.MODEL)
    if record.get("kind") != kind:
        raise checks.InputError(f"{folder}: holds no model of this kind; give a folder that stage {stage} wrote")
    for name in sections.keys() - record.keys():
        raise checks.InputError(f"{folder}: its record has no section {name}")
    return record, [config.recorded(record[name], cls, f"{folder}: {name}") for name, cls in sections.items()]

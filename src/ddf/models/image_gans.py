"""The two image GANs: colours from the normals of a shape and a texture, and colours from noise. [DDF22] §4.4.

The first has the VAE's decoder in it, frozen, so that its file alone makes images: latent, field, normals, colours.
"""

from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import model_files, pddf
from ddf.models import generative_settings, image_networks, records, translators

BETAS = (0.0, 0.9)  # of Adam
KIND, KIND_2D = "image_gan", "image_gan_2d"  # of the files' records


class ImageGAN(nn.Module):
    """f_T, its critic D, and g_T and h_T, which say what f_T kept of the normals and of the texture."""

    field_scale: Float[Tensor, ""]

    def __init__(self, vae: generative_settings.VAEConfig, gan: generative_settings.GANConfig) -> None:
        super().__init__()
        self.vae, self.config = vae, gan
        self.decoder = pddf.ConditionalPDDF(vae.field, vae.latent_features).requires_grad_(False)
        self.register_buffer("field_scale", torch.ones(()))
        self.colours = translators.Translator(gan.texture_features, gan.translator_width, upsampling=gan.upsampling)
        self.normals = translators.Translator(0, gan.translator_width, upsampling=gan.upsampling)
        self.textures = translators.TextureEncoder(gan.texture_features, gan.texture_width)
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


def load(folder: Path) -> ImageGAN:
    """The image GAN of a folder that stage `train_gan` wrote, in evaluation mode.

    Raises:
      FileNotFoundError: there is none. InputError: the file is damaged, or holds something else.
    """
    record = records.read(folder, KIND, "train_gan")
    vae = records.section(record, "vae", generative_settings.VAEConfig, folder)
    gan = records.section(record, "gan", generative_settings.GANConfig, folder)
    return model_files.built(lambda: ImageGAN(vae, gan), folder)


def load_2d(folder: Path) -> NoiseGAN:
    """The 2D GAN of a folder that stage `train_gan2d` wrote; as `load`."""
    record = records.read(folder, KIND_2D, "train_gan2d")
    gan = records.section(record, "gan", generative_settings.GANConfig, folder)
    return model_files.built(lambda: NoiseGAN(gan), folder)

"""Tiny generative models, their settings and data, for several tests."""

import dataclasses

import _hand_made
import _models
import numpy as np
import torch

from ddf.data.batches import category_data
from ddf.models import generated_images, generative_models, generative_settings
from ddf.training import shape_data

LOOP = dataclasses.replace(_models.LOOP, checkpoint_seconds=0.0)
VAE = generative_settings.VAEConfig(
    _models.FIELD, 5, 8, 10, 1, 2, 4, _hand_made.COUNTS, _models.WEIGHTS, 0.05, LOOP, 1e-3
)
NORMALS = generative_settings.NormalsConfig(4, (25.0, 30.0))
GAN = generative_settings.GANConfig(NORMALS, 3, 2, 2, 16, "nearest", 4, 2, 10.0, 3, LOOP)
FEATURES = generative_settings.FeaturesConfig(2, 4, 2, LOOP)
SCORES = generative_settings.ScoresConfig(FEATURES, 8, 2, 6, 0.05, 40, 2)


def vae():
    torch.manual_seed(0)
    return generative_models.ShapeVAE(VAE).eval()


def shapes():
    return shape_data.Shapes([f"shape{i}" for i in range(3)], _hand_made.samples(), np.array([2.0, 3.0, 4.0]))


def image_gan():
    torch.manual_seed(0)
    made = generative_models.ImageGAN(VAE, GAN)
    made.decoder.load_state_dict(vae().decoder.state_dict())
    return made


def noise_gan():
    torch.manual_seed(0)
    return generative_models.NoiseGAN(GAN)


def images(count=6):
    generator = torch.Generator().manual_seed(0)
    made = (torch.rand(count, 4, 64, 64, generator=generator) * 255).to(torch.uint8)
    poses = torch.rand(count, 3, generator=generator)
    return category_data.ImageSet(["a", "b"], [0] * count, np.arange(count) % 2, made, poses)


def normals(count=4):
    """A square of normals in the middle of each image."""
    made = np.zeros((count, 3, 64, 64), np.int8)
    made[:, 2, 16:48, 16:48] = generated_images.LEVELS
    made[:, 0, 16 : 16 + 4 * count : 4, 16:48] = 30
    return torch.from_numpy(made)

"""The shape VAE: points with normals to a latent, a latent to a directed distance field. [DDF22] app. genmodel.

Of a latent the decoder's modulations are constants, so that a shape is a plain field: they fold into the weights
(`plain_field`), and what reads a field of one shape reads a sample of the VAE.
"""

from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import model_files, pddf, shape_field
from ddf.models import generative_settings, point_encoder, records

KIND = "vae"  # of the file's record


class ShapeVAE(nn.Module):
    """E and its heads, and the conditional PDDF that decodes.

    field_scale: field units per v1 unit, the mean over the shapes that were learned: what a sample of the prior, which
    no mesh has given a size, is drawn at.
    """

    field_scale: Float[Tensor, ""]

    def __init__(self, config: generative_settings.VAEConfig) -> None:
        super().__init__()
        self.config = config
        self.posterior = point_encoder.Posterior(config.latent_features, config.encoder_width)
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


def write_field(folder: Path, field: pddf.PDDF, field_scale: float, record: dict[str, Any]) -> Path:
    """A plain field as `ddf fit` writes it: its box is the cube, the frame of its mesh is v1; the file."""
    return shape_field.save(shape_field.conditioned(field, None, 1 / field_scale), folder, record)


def load(folder: Path) -> ShapeVAE:
    """The VAE of a folder that stage `train_vae` wrote, in evaluation mode.

    Raises:
      FileNotFoundError: there is none. InputError: the file is damaged, or holds something else.
    """
    record = records.read(folder, KIND, "train_vae")
    config = records.section(record, "vae", generative_settings.VAEConfig, folder)
    return model_files.built(lambda: ShapeVAE(config), folder)

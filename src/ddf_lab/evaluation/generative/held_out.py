"""Shapes that the VAE did not learn: through its encoder, and by latents optimised on their samples (auto-decoding).

The second is what the decoder can do at best; what the first adds to its error is the encoder's. Park et al. 2019.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.core import provenance
from ddf.data import packing
from ddf.data.samples import sample_types
from ddf.fields import losses, rendering
from ddf.fit import fitting, shape_samples
from ddf.models import generative_models, generative_settings
from ddf.training import shape_data, training_loop

SAMPLES = 1000  # of each type of a held-out shape, that errors are measured on


@torch.no_grad()
def encode(
    model: generative_models.ShapeVAE, shapes: shape_data.Shapes, seed: int
) -> tuple[Float[Tensor, "n z"], Float[Tensor, "n z"]]:
    """Mean and log-variance of every shape, from random points of it."""
    place = model.field_scale.device
    clouds = shapes.clouds(np.arange(len(shapes.ids)), model.config.points, np.random.default_rng(seed))
    mean, log_variance = model.posterior(*(values.to(place) for values in clouds))
    return mean, log_variance


class Latents(nn.Module):
    """One latent a shape; they start at 0, the middle of the prior."""

    def __init__(self, shapes: int, features: int) -> None:
        super().__init__()
        self.values = nn.Parameter(torch.zeros(shapes, features))


def auto_decode(
    model: generative_models.ShapeVAE,
    shapes: shape_data.Shapes,
    section: generative_settings.ScoresConfig,
    folder: Path,
) -> Float[Tensor, "n z"]:
    """Latents that Adam finds for the frozen decoder, by the VAE's shape loss on samples of each shape."""
    vae, place = model.config, model.field_scale.device
    model.decoder.requires_grad_(False)
    found = Latents(len(shapes.ids), vae.latent_features).to(place)
    everyone = np.arange(len(shapes.ids))

    def step_loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        points = shapes.samples.draw(everyone, vae.counts, np.random.default_rng((section.seed, step))).to(place)
        modulations = model.decoder.modulator(found.values)
        loss, _ = losses.shape_loss(model.decoder.field, points, modulations, vae.weights)
        return loss, {}

    loop = generative_settings.auto_loop(section)
    weights = b"".join(value.cpu().numpy().tobytes() for value in model.state_dict().values())
    facts = [section.auto_steps, loop, vae, list(shapes.ids), hashlib.sha256(weights).hexdigest()]
    record = provenance.record(facts, section.seed, (), __name__)
    groups = [{"params": [found.values], "weight_decay": 0.0}]
    training_loop.fit(found, groups, step_loss, section.auto_steps, loop, folder, record, "latents")
    return found.values.detach()


def errors(
    model: generative_models.ShapeVAE, latents: Float[Tensor, "n z"], shapes: shape_data.Shapes
) -> dict[str, dict[str, float]]:
    """Means over the shapes of `fitting.held_out_errors`: depth and visibility by sample type, median normals."""
    every = [
        fitting.held_out_errors(generative_models.plain_field(model.decoder, latent), _samples(shapes, row))
        for row, latent in enumerate(latents)
    ]
    by_type = {
        name: {kind: float(np.mean([found[name][kind] for found in every])) for kind in every[0][name]}
        for name in ("depth_l1", "visibility_bce")
    }
    return by_type | {"normals": {"median_deg": float(np.mean([found["normal_angle_deg_median"] for found in every]))}}


def _samples(shapes: shape_data.Shapes, row: int) -> shape_samples.ShapeSamples:
    """The first stored samples of a shape."""
    number, place = shapes.samples.places[row]
    shard = shapes.samples.shards[number]
    arrays: dict[str, Mapping[str, Tensor]] = {}
    for kind in sample_types.KINDS:
        codes = {name: torch.from_numpy(shard[f"{kind}.{name}"][place][:SAMPLES].copy()) for name in packing.FIELDS}
        decoded = packing.decode_fields(codes)
        arrays[kind] = {
            "positions": decoded["positions"],
            "directions": decoded["directions"],
            "visible": decoded["visible"].float(),
            "depth": decoded["depth"].masked_fill(~decoded["visible"], 0.0),
            "normals": decoded["normals"],
        }
    upper = np.full(3, rendering.CUBE_HALF)
    return shape_samples.ShapeSamples(arrays, -upper, upper)


def divergences(model: generative_models.ShapeVAE, shapes: shape_data.Shapes, seed: int) -> Float[Tensor, "z"]:
    """L_KL of every dimension, mean over the shapes, nats, largest first."""
    found = generative_models.divergence(*encode(model, shapes, seed)).mean(dim=0)
    return found.sort(descending=True).values


def summary(by_dimension: Float[Tensor, "z"]) -> dict[str, Any]:
    """The sum, how many dimensions say more than 0.1 nats, and all of them."""
    values = by_dimension.tolist()
    return {"sum": sum(values), "used": sum(value > 0.1 for value in values), "by_dimension": values}

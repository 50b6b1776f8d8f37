"""Shapes of a VAE: those that it did not learn, clouds of its fields against true ones, samples of the prior.

Held-out shapes go through its encoder, and are fitted by latents optimised on their samples (auto-decoding): the second
is what the decoder can do at best; what the first adds to its error is the encoder's. Park et al. 2019. Clouds are in
the benchmark frame (0.57 x v1, `metrics`). Distances between shapes are D_C, a sum of two means of squares.
"""

import hashlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.core import provenance
from ddf.data.batches import category_data
from ddf.fields import losses, pddf, rendering, shape_field
from ddf.geometry import neighbours, transforms
from ddf.metrics import cloud_scores
from ddf.models import generative_models, generative_settings
from ddf.training import shape_data, training_loop

Clouds = Sequence[neighbours.Neighbours]


@torch.no_grad()
def encode(
    model: generative_models.ShapeVAE, shapes: shape_data.Shapes, seed: int
) -> tuple[Float[Tensor, "n z"], Float[Tensor, "n z"]]:
    """Mean and log-variance of every shape, from random points of it."""
    place = model.field_scale.device
    clouds = shapes.clouds(np.arange(len(shapes.ids)), model.config.points, np.random.default_rng(seed))
    mean, log_variance = model.posterior(*(values.to(place) for values in clouds))
    return mean, log_variance


def auto_decode(
    model: generative_models.ShapeVAE,
    shapes: shape_data.Shapes,
    section: generative_settings.ScoresConfig,
    folder: Path,
) -> Float[Tensor, "n z"]:
    """Latents that Adam finds for the frozen decoder, by the VAE's shape loss on samples of each shape."""
    vae, place = model.config, model.field_scale.device
    model.decoder.requires_grad_(False)
    middle = torch.zeros(len(shapes.ids), vae.latent_features)  # of the prior
    found = nn.ParameterDict({"z": middle}).to(place)
    everyone = np.arange(len(shapes.ids))

    def step_loss(step: int) -> tuple[Tensor, dict[str, Tensor]]:
        points = shapes.samples.draw(everyone, vae.counts, np.random.default_rng((section.seed, step))).to(place)
        modulations = model.decoder.modulator(found["z"])
        loss, _ = losses.shape_loss(model.decoder.field, points, modulations, vae.weights)
        return loss, {}

    loop = generative_settings.auto_loop(section)
    weights = b"".join(value.cpu().numpy().tobytes() for value in model.state_dict().values())
    facts = [section.auto_steps, loop, vae, list(shapes.ids), hashlib.sha256(weights).hexdigest()]
    record = provenance.record(facts, section.seed, (), __name__)
    groups = [{"params": [found["z"]], "weight_decay": 0.0}]
    training_loop.fit(found, groups, step_loss, section.auto_steps, loop, folder, record, "latents")
    return found["z"].detach()


def divergence(model: generative_models.ShapeVAE, shapes: shape_data.Shapes, seed: int) -> dict[str, float]:
    """L_KL in nats, mean over the shapes: the sum, how many dimensions say more than 0.1, and of how many."""
    found = generative_models.divergence(*encode(model, shapes, seed)).mean(dim=0)
    return {"sum": float(found.sum()), "used": int((found > 0.1).sum()), "dimensions": len(found)}


def of_fields(fields: Sequence[pddf.PDDF], scales: Sequence[float], count: int, seed: int) -> Clouds:
    """A cloud of each field. scales: field units per v1 unit, the true ones or those of a prior's sample."""
    upper = np.full(3, rendering.CUBE_HALF)
    found = []
    for field, scale in zip(fields, scales, strict=True):
        shape = shape_field.ShapeField(field, -upper, upper, transforms.Similarity(scale), {})
        drawn = shape.points(count, seed)
        found.append(neighbours.Neighbours(drawn * transforms.BENCHMARK_FROM_V1, "cloud of a field"))
    return found


def of_shapes(shapes: category_data.ShapeSet, count: int, seed: int) -> Clouds:
    """A random part of each true cloud."""
    random, found = np.random.default_rng(seed), []
    for row, similarity in enumerate(shapes.similarities):
        cloud = shapes.subsets(np.array([row]), count, random)[0].double().numpy()
        points = similarity.inverse().apply(cloud) * transforms.BENCHMARK_FROM_V1
        found.append(neighbours.Neighbours(points, "true cloud"))
    return found


def compared(predicted: Clouds, truth: Clouds) -> dict[str, float]:
    """Means of what reports print, D_C x 1000 and so on, of predictions and truths in the same order."""
    scores = [cloud_scores.compare_clouds(one, other) for one, other in zip(predicted, truth, strict=True)]
    return {
        name: metric.factor * float(np.mean([score.scores[metric.score] for score in scores]))
        for name, metric in cloud_scores.PRINTED.items()
    }


def chamfer(one: neighbours.Neighbours, other: neighbours.Neighbours) -> float:
    """D_C."""
    return cloud_scores.chamfer_l2_sq(other.dist_sq(one), one.dist_sq(other))


def nearest(clouds: Clouds, others: Clouds) -> list[int]:
    """Which of the others is the nearest to each cloud, by D_C."""
    return [int(np.argmin([chamfer(cloud, other) for other in others])) for cloud in clouds]


def distribution(made: Clouds, truth: Clouds) -> dict[str, float]:
    """How alike two sets of shapes are, by D_C.

    Returns:
      matching_x1000: mean over the true shapes of D_C x 1000 to the nearest made one; coverage: share of the true
      shapes that are the nearest to some made one (both Achlioptas et al. 2018). told_apart: share of all shapes whose
      nearest other one is of their own set, 0.5 where nothing tells the sets apart (Yang et al. 2019); copies of the
      mean shape, the nearest of many, can fool it. energy_x1000: 2 E|x - y| - E|x - x'| - E|y - y'| with sqrt(D_C) as
      the distance, which they cannot (Székely & Rizzo 2013).
    """
    everyone = [*made, *truth]
    distances = np.full((len(everyone),) * 2, np.inf)
    for row, one in enumerate(everyone):
        for column in range(row):
            distances[row, column] = distances[column, row] = chamfer(one, everyone[column])
    across = distances[: len(made), len(made) :]
    own = np.arange(len(everyone)) < len(made)
    apart = np.sqrt(np.where(np.isfinite(distances), distances, 0.0))
    within = [apart[np.ix_(each, each)].mean() for each in (own, ~own)]
    return {
        "matching_x1000": 1000 * float(across.min(0).mean()),
        "coverage": len(set(across.argmin(1).tolist())) / len(truth),
        "told_apart": float((own[distances.argmin(1)] == own).mean()),
        "energy_x1000": 1000 * float(2 * apart[own][:, ~own].mean() - sum(within)),
    }

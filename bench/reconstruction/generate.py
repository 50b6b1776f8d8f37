"""Shapes of `ddf generate` beside new procedural ones, which no training saw: 40 clouds of what is seen from outside.

Rows: other true shapes; samples; and three fakes that a score must rank behind these: the mean shape again and again,
samples drawn towards it, samples with noise. MMD, coverage, 1-NNA and energy as in `generative_shapes.distribution`,
the shares in percent. The prior's width was chosen by MMD and 1-NNA on chairs: `--seed 71 --width` .6, .8, 1 and 1.2.
Seconds are processor time of one shape, of one thread.
"""

import time

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from bench.lib import measuring
from ddf.core import shipped_models
from ddf.data import true_clouds
from ddf.data.synthetic import write
from ddf.fields import cloud_projection, pddf
from ddf.fit import latent_prior
from ddf.geometry import neighbours, transforms
from ddf.geometry.mesh_io import Mesh
from ddf.models import generated_images
from ddf_lab.evaluation import generative_shapes

KEPT = True  # rows of other categories
COUNT, POINTS, TRUTH_POINTS = 40, 1500, 6000
BLUR, NOISE = 0.3, 0.03  # width of the blurred samples' prior; standard deviation in v1
K = transforms.BENCHMARK_FROM_V1


def framed(points: Float[np.ndarray, "n 3"], noise: float = 0.0) -> neighbours.Neighbours:
    """A cloud whose box is centred, with the diagonal of v1, in benchmark units: samples have no size of their own."""
    low, high = points.min(axis=0), points.max(axis=0)
    placed = (points - (low + high) / 2) / np.linalg.norm(high - low)
    return neighbours.Neighbours(K * (placed + noise * np.random.default_rng(0).normal(size=placed.shape)))


def truth(category: str, seed: int) -> list[neighbours.Neighbours]:
    """Clouds of procedural shapes, without hidden points."""
    found = []
    for index in range(COUNT):
        shape, random = write.make_shape(seed, category, index, wide=True), np.random.default_rng(index)
        cloud = true_clouds.draw(Mesh(shape.vertices, shape.triangles), TRUTH_POINTS, random)
        seen = cloud.points[~cloud.hidden].astype(np.float64)
        found.append(framed(seen[random.permutation(len(seen))[:POINTS]]))
    return found


@torch.no_grad()
def decoded(
    decoder: pddf.ConditionalPDDF, latents: Float[Tensor, "n z"], noise: float = 0.0
) -> list[neighbours.Neighbours]:
    """Clouds of the shapes of latents."""
    drawn, found = cloud_projection.USUAL, []
    for row, latent in enumerate(latents):
        modulations = [each[0] for each in decoder.modulations(latent[None])]
        cycles = cloud_projection.sample(decoder.field, modulations, POINTS, drawn, torch.Generator().manual_seed(row))
        found.append(framed(cloud_projection.select(cycles, [POINTS], drawn)[0].double().numpy(), noise))
    return found


def rows(category: str, seed: int, width: float) -> measuring.Rows:
    """Of a category, one after the other."""
    folder = shipped_models.place(category)
    decoder, prior, _ = latent_prior.load(folder)
    latents = width * generated_images.latents(COUNT, prior.basis.shape[1], 0, "samples")
    known, others = truth(category, seed), seed + 1000
    sets = {
        "other true shapes": lambda: truth(category, others),
        "samples": lambda: decoded(decoder, prior.latents(latents)),
        "mean shape": lambda: decoded(decoder, prior.latents(0 * latents)),
        "blurred samples": lambda: decoded(decoder, prior.latents(BLUR * latents)),
        "noisy samples": lambda: decoded(decoder, prior.latents(latents), NOISE),
    }
    for name, make in sets.items():
        started = time.process_time()
        made = make()
        seconds = (time.process_time() - started) / COUNT
        found = generative_shapes.distribution(made, known)
        error = {
            "mmd_x1000": found["matching_x1000"],
            "coverage_percent": 100 * found["coverage"],
            "one_nna_percent": 100 * found["told_apart"],
            "energy_x1000": found["energy_x1000"],
        }
        yield measuring.row(f"{category}: {name}", {"shapes": COUNT, "points": POINTS}, [seconds], error)


def main(
    *,
    categories: list[str] = ["chair", "plane", "car"],  # noqa: B006
    seed: int = 73,
    width: float = 1.0,
) -> measuring.Rows:
    """Every category.

    Args:
      categories: their names.
      seed: of the procedural shapes.
      width: of the prior.
    """
    for category in categories:
        yield from rows(category, seed, width)

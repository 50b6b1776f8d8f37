"""Clouds of a shape VAE's fields against true ones, and samples of the prior against what was learned and held out.

All in the benchmark frame (0.57 x v1, `metrics`). Distances between shapes are D_C, a sum of two means of squares.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.data.batches import category_data
from ddf.fields import cloud_defaults, pddf, rendering, shape_field
from ddf.geometry import neighbours, transforms
from ddf.metrics import cloud_scores

Clouds = Sequence[neighbours.Neighbours]


def of_fields(fields: Sequence[pddf.PDDF], scales: Sequence[float], count: int, seed: int) -> Clouds:
    """A cloud of each field. scales: field units per v1 unit, the true ones or those of a prior's sample."""
    upper = np.full(3, rendering.CUBE_HALF)
    found = []
    for field, scale in zip(fields, scales, strict=True):
        shape = shape_field.ShapeField(field, -upper, upper, transforms.Similarity(scale), {})
        drawn = shape_field.cloud(shape, count, cloud_defaults.cloud(), seed)
        found.append(neighbours.Neighbours(drawn * transforms.BENCHMARK_FROM_V1, "cloud of a field"))
    return found


def of_shapes(shapes: category_data.ShapeSet, count: int, seed: int) -> Clouds:
    """A random part of each true cloud."""
    random, found = np.random.default_rng(seed), []
    for row, similarity in enumerate(shapes.similarities):
        cloud = shapes.subset(row, count, random).double().numpy()
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


def nearest(clouds: Clouds, others: Clouds, same: Sequence[int] | None = None) -> list[tuple[int, float]]:
    """The nearest of the others to each cloud, and its D_C x 1000.

    Args:
      same: of each cloud its own number among the others, which does not count.
    """
    found = []
    for row, cloud in enumerate(clouds):
        distances = np.array([chamfer(cloud, other) for other in others])
        if same is not None:
            distances[same[row]] = np.inf
        found.append((int(distances.argmin()), 1000 * float(distances.min())))
    return found


def novelty(samples: Clouds, learned: Clouds, ids: Sequence[str], pairs: int) -> dict[str, Any]:
    """How far samples are from the nearest learned shape, against how far some learned shapes are from theirs."""
    of_samples = nearest(samples, learned)
    rows = spaced(len(learned), pairs)
    of_learned = nearest([learned[row] for row in rows], learned, rows)
    return {
        "nearest": [ids[row] for row, _ in of_samples],
        "chamfer_x1000": [distance for _, distance in of_samples],
        "between_learned_x1000": [distance for _, distance in of_learned],
    }


def spaced(total: int, count: int) -> list[int]:
    """So many of `total` numbers from 0 on, or all, at even distances."""
    return np.linspace(0, total - 1, min(count, total)).round().astype(int).tolist()


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


def spread(values: Sequence[float]) -> Float[np.ndarray, "3"]:
    """Least, median and largest."""
    return np.quantile(np.asarray(values, dtype=np.float64), [0.0, 0.5, 1.0])

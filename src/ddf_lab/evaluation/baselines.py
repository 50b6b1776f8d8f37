"""Rows that need no decoder: what a mean shape, a retrieved shape and the truth itself score.

They say what the numbers of the models mean. Retrieval matches many networks (Tatarchenko et al. 2019), the mean
shape ignores the image, and the ceiling is what a perfect method reaches with that many points. A baseline's
"prediction" is a random subset of ground-truth points, in the benchmark frame and at the true camera (`Pi_g`).
"""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import joblib
import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.data import packing
from ddf.geometry import neighbours, transforms
from ddf.metrics import cloud_scores
from ddf_lab.evaluation import scoring

MEAN_SHAPE, RETRIEVAL, ORACLE, CEILING = "mean_shape", "retrieval", "oracle_retrieval", "ceiling"

Truths = Mapping[str, packing.Cloud]
Images = Sequence[tuple[str, int]]


def subset(points: Float[np.ndarray, "n 3"], count: int, seed: int, name: str) -> Float[np.ndarray, "m 3"]:
    """`count` of the points at random, without repetition; the same for the same seed and name. InputError: too few."""
    if len(points) < count:
        raise checks.InputError(f"{name}: a subset of {count} points was asked for, the cloud has only {len(points)}")
    generator = np.random.default_rng([seed, zlib.crc32(name.encode())])
    return points[generator.permutation(len(points))[:count]]


@dataclass(frozen=True)
class Baselines:
    """All of one category, made by `prepare`.

    sizes: points per size letter, as the models' clouds have ("L": 5000, "S": 2466). retrieved, mean, oracle: of
    `retrieval_choice`, `mean_shape` and `oracle_choice`. Without a mean, retrieval alone: of a further training, which
    changes nothing but its features.
    """

    truths: Truths
    sizes: Mapping[str, int]
    seed: int
    retrieved: Mapping[tuple[str, int], str]
    mean: Mapping[str, Float[np.ndarray, "n 3"]] = field(default_factory=dict)
    oracle: Mapping[str, str] = field(default_factory=dict)

    def cases(self, shape: str, images: Images) -> list[scoring.Case]:
        """Those of all sizes for the images of one test shape. The ceiling is the truth against itself."""
        found = []
        for letter, count in self.sizes.items():
            column = f"Pi_g-{letter}"
            own = [
                scoring.Case(RETRIEVAL, column, [image], _points(self.truths, self.retrieved[image], count, self.seed))
                for image in images
            ]
            if self.mean:
                best, truth = (_points(self.truths, name, count, self.seed) for name in (self.oracle[shape], shape))
                own.insert(0, scoring.Case(MEAN_SHAPE, column, images, self.mean[letter]))
                own.insert(1, scoring.Case(ORACLE, column, images, best))
                own.append(scoring.Case(CEILING, column, images, truth))
            found += own
        return found


def prepare(
    ddf: scoring.Predictions,
    truths: Truths,
    train_ids: Sequence[str],
    validation_ids: Sequence[str],
    sizes: Mapping[str, int],
    config: scoring.EvaluateConfig,
    jobs: int | None = None,
) -> Baselines:
    """Choose what the baselines answer for the images of one category.

    Args:
      ddf: images to evaluate, and the encoder's features for the retrieval row.
      train_ids: shapes that the models have seen. validation_ids: by which the mean shape is chosen. Without a cloud
        they are left out.
    """
    train_ids, held = ([shape for shape in ids if shape in truths] for ids in (train_ids, validation_ids))
    if not train_ids:
        raise checks.InputError("no training shape has a ground-truth cloud; the baselines need one")
    test_ids = list(scoring.views_by_shape(ddf.images))
    mean = mean_shape(truths, train_ids, held, sizes, config)
    oracle = oracle_choice(test_ids, train_ids, truths, sizes["L"], config, jobs)
    return Baselines(truths, sizes, config.seed, retrieval_choice(ddf, truths), mean, oracle)


def mean_shape(
    truths: Truths,
    train_ids: Sequence[str],
    validation_ids: Sequence[str],
    sizes: Mapping[str, int],
    config: scoring.EvaluateConfig,
) -> dict[str, Float[np.ndarray, "n 3"]]:
    """One answer to every image: of points of all training clouds together, and of each training shape alone, what has
    the least mean D_C to the validation shapes; points of all together where none are held out. By size letter.
    """
    union = transforms.BENCHMARK_FROM_V1 * np.concatenate([truths[shape].points for shape in train_ids])
    clouds = {letter: subset(union, count, config.seed, f"mean {letter}") for letter, count in sizes.items()}
    if not validation_ids:
        return clouds
    held = [neighbours.Neighbours(truths[shape].benchmark_points(), shape) for shape in validation_ids]

    def distance(cloud: Float[np.ndarray, "n 3"]) -> float:
        tree = neighbours.Neighbours(cloud)
        both = [cloud_scores.chamfer_l2_sq(tree.dist_sq(truth), truth.dist_sq(tree)) for truth in held]
        return float(np.mean(both))

    alone = {shape: distance(_few(truths, shape, config)) for shape in train_ids}
    best = min(alone, key=lambda shape: (alone[shape], shape))
    if distance(subset(union, len(_few(truths, best, config)), config.seed, "mean")) <= alone[best]:
        return clouds
    return {letter: _points(truths, best, count, config.seed) for letter, count in sizes.items()}


def _points(truths: Truths, shape: str, count: int, seed: int) -> Float[np.ndarray, "n 3"]:
    return subset(truths[shape].benchmark_points(), count, seed, shape)


def _few(truths: Truths, shape: str, config: scoring.EvaluateConfig) -> Float[np.ndarray, "n 3"]:
    """Those that shapes are ranked by."""
    return _points(truths, shape, min(config.oracle_points, len(truths[shape].points)), config.seed)


def retrieval_choice(ddf: scoring.Predictions, truths: Truths) -> dict[tuple[str, int], str]:
    """For every test image the shape of the training image whose encoder feature is nearest (Euclidean)."""
    shapes = np.array([str(image["id"]) for image in ddf.metadata["train_images"]])
    usable = np.array([shape in truths for shape in shapes], dtype=bool)
    train = ddf.tensors["train_features"][usable].astype(np.float64)
    choice = {}
    for image, feature in zip(ddf.images, ddf.tensors["features"].astype(np.float64), strict=True):
        choice[image] = str(shapes[usable][int(((train - feature) ** 2).sum(axis=1).argmin())])
    return choice


def oracle_choice(
    test_ids: Sequence[str],
    train_ids: Sequence[str],
    truths: Truths,
    count: int,
    config: scoring.EvaluateConfig,
    jobs: int | None = None,
) -> dict[str, str]:
    """For every test shape the training shape with the smallest D_C, `count` points against the whole truth.

    All training shapes are ranked with small clouds on both sides; the `oracle_shortlist` best are then compared in
    full.
    """
    small = {shape: _few(truths, shape, config) for shape in {*train_ids, *test_ids}}
    candidates = {shape: small[shape] for shape in train_ids}
    parallel = joblib.Parallel(n_jobs=min(jobs or joblib.cpu_count(), len(test_ids)))
    shortlists = parallel(
        joblib.delayed(_shortlist)([small[shape] for shape in batch], candidates, config.oracle_shortlist)
        for batch in (test_ids[start : start + 16] for start in range(0, len(test_ids), 16))
    )
    ranked = [names for batch in shortlists for names in batch]
    best = parallel(
        joblib.delayed(_shortlist)(
            [truths[shape].benchmark_points()], {name: _points(truths, name, count, config.seed) for name in names}, 1
        )
        for shape, names in zip(test_ids, ranked, strict=True)
    )
    return {shape: found[0][0] for shape, found in zip(test_ids, best, strict=True)}


def _shortlist(
    shapes: Sequence[Float[np.ndarray, "n 3"]], candidates: Mapping[str, Float[np.ndarray, "m 3"]], length: int
) -> list[list[str]]:
    trees = {name: neighbours.Neighbours(points, name) for name, points in candidates.items()}
    return [_least(trees, neighbours.Neighbours(points), length) for points in shapes]


def _least(trees: Mapping[str, neighbours.Neighbours], truth: neighbours.Neighbours, length: int) -> list[str]:
    """Names of the clouds with the least D_C to the truth, equal ones by name.

    One direction of D_C tells most of them apart: the other is asked for as long as it can matter.
    """
    one_way = {name: truth.dist_sq(tree) for name, tree in trees.items()}
    least = {name: float(dist_sq.mean()) for name, dist_sq in one_way.items()}
    best: list[tuple[float, str]] = []
    for name in sorted(least, key=lambda name: (least[name], name)):
        if len(best) == length and least[name] > best[-1][0]:
            break
        score = cloud_scores.chamfer_l2_sq(one_way[name], trees[name].dist_sq(truth))
        best = sorted([*best, (score, name)])[:length]
    return [name for _, name in best]

"""KID of pictures on named features, by torch-fidelity, and whether it ranks spoiled ones as it must.

Sources: Bińkowski et al. 2018 (KID: unbiased, cubic kernel, mean over subsets). Precision and recall are left out: of
the mean image precision is 1. Features come from `image_features` and are made once an image, so that torch-fidelity is
given the features and not the images.
"""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torchvision.transforms import functional as transforms

from ddf.core import checks

BLURS = (2.0, 4.0)  # standard deviations, pixels
NOISES = (0.05, 0.15)  # standard deviations, of colours in [0, 1]


@dataclass(frozen=True)
class Subsets:
    """On how many subsets of how many images KID is computed."""

    count: int
    size: int
    seed: int = 0


def score(images: Float[Tensor, "n features"], real: Float[Tensor, "m features"], subsets: Subsets) -> dict[str, float]:
    """Of features of images against those of real ones: `kid`, and `kid_spread`, its deviation over the subsets."""
    from torch_fidelity import metric_kid

    of_kid = {"kid_subsets": subsets.count, "kid_subset_size": subsets.size, "rng_seed": subsets.seed}
    kid = metric_kid.kid_features_to_metric(images.double(), real.double(), verbose=False, **of_kid)
    return {"kid": kid[metric_kid.KEY_METRIC_KID_MEAN], "kid_spread": kid[metric_kid.KEY_METRIC_KID_STD]}


def blurred(images: Float[Tensor, "n 3 h w"], spread: float) -> Float[Tensor, "n 3 h w"]:
    """Images behind a Gaussian of that many pixels."""
    reach = 2 * int(np.ceil(2 * spread)) + 1
    return transforms.gaussian_blur(images, [reach, reach], [spread, spread])


def noisy(images: Float[Tensor, "n 3 h w"], spread: float, seed: int) -> Float[Tensor, "n 3 h w"]:
    """Images in [-1, 1] with normal noise, which `spread` states for colours in [0, 1]."""
    generator = torch.Generator().manual_seed(seed)
    return (images + 2 * spread * torch.randn(images.shape, generator=generator)).clamp(-1, 1)


def spoiled(images: Float[Tensor, "n 3 h w"], seed: int) -> dict[str, Float[Tensor, "n 3 h w"]]:
    """Real images made worse in ways whose order is known, by name."""
    by_blur = {f"blur {spread:g}": blurred(images, spread) for spread in BLURS}
    return by_blur | {f"noise {spread:g}": noisy(images, spread, seed) for spread in NOISES}


def in_order(kids: Mapping[str, float]) -> bool:
    """Whether ceiling < blur 2 < blur 4 and ceiling < noise .05 < noise .15; else the score is of no use."""
    chains = (("blur", BLURS), ("noise", NOISES))
    values = [[kids["ceiling"], *(kids[f"{name} {spread:g}"] for spread in spreads)] for name, spreads in chains]
    return all(first < second for chain in values for first, second in itertools.pairwise(chain))


def table(
    sets: Mapping[str, Float[Tensor, "_ features"]], real: Float[Tensor, "m features"], subsets: Subsets
) -> dict[str, Any]:
    """Scores of every set of images by name, and whether KID ranks the spoiled ones as it must.

    Raises:
      InputError: a set has fewer images than a subset.
    """
    for name, features in {**sets, "real": real}.items():
        if len(features) < subsets.size:
            raise checks.InputError(
                f"scores.subset_size must be at most the {len(features)} images of {name!r}; got {subsets.size}"
            )
    rows = {name: score(features, real, subsets) for name, features in sets.items()}
    return {"rows": rows, "in_order": in_order({name: row["kid"] for name, row in rows.items()})}

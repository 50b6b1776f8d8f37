"""Scores of pictures: KID on named features, by torch-fidelity, and whether colours stay on the surface.

Sources: Bińkowski et al. 2018 (KID: unbiased, cubic kernel, mean over subsets). Precision and recall are left out: of
the mean image precision is 1. Features come from `image_features` and are made once an image, so that torch-fidelity is
given the features and not the images.

Colours stay on the surface if a point has one colour in two images (derived here). A pixel of one image is a surface
point q; where q projects into the other image, and is not hidden there, both images show the same point. The error is
the mean absolute difference of their colours in [0, 1].
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional
from torchvision.transforms import functional as transforms

from ddf.core import checks
from ddf.geometry import cameras

BLURS = (2.0, 4.0)  # standard deviations, pixels
NOISES = (0.05, 0.15)  # standard deviations, of colours in [0, 1]


@dataclass(frozen=True)
class Subsets:
    """On how many subsets of how many images KID is computed."""

    count: int
    size: int
    seed: int = 0


@dataclass(frozen=True)
class ImageScores:
    """Of a set of images against real ones. kid_spread: standard deviation over the subsets."""

    kid: float
    kid_spread: float


def score(images: Float[Tensor, "n features"], real: Float[Tensor, "m features"], subsets: Subsets) -> ImageScores:
    """Of features of images against those of real ones."""
    from torch_fidelity import metric_kid

    of_kid = {"kid_subsets": subsets.count, "kid_subset_size": subsets.size, "rng_seed": subsets.seed}
    kid = metric_kid.kid_features_to_metric(images.double(), real.double(), verbose=False, **of_kid)
    return ImageScores(
        kid[metric_kid.KEY_METRIC_KID_MEAN],
        kid[metric_kid.KEY_METRIC_KID_STD],
    )


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
    sets: Mapping[str, Float[Tensor, "_ features"]],
    real: Float[Tensor, "m features"],
    subsets: Subsets,
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
    rows = {name: asdict(score(features, real, subsets)) for name, features in sets.items()}
    return {"rows": rows, "in_order": in_order({name: row["kid"] for name, row in rows.items()})}


HIDDEN = 0.02  # benchmark units: a surface this much nearer hides a point; depth steps are smaller on 64 pixels


@dataclass(frozen=True)
class CameraPicture:
    """An image in [0, 1], its camera (benchmark frame), and distance along each pixel's ray, `inf` off the surface."""

    camera: Float[Tensor, "3"]
    distance: Float[Tensor, "h w"]
    colours: Float[Tensor, "3 h w"]


def colour_differences(first: CameraPicture, second: CameraPicture) -> Float[Tensor, "k"]:
    """|colour in the first - colour in the second|, mean of the channels, of each point of the first that both see."""
    size = first.distance.shape[0]
    directions = cameras.pixel_directions(size, first.camera).reshape(-1, 3)
    centre, world = cameras.pixel_rays(first.camera[0], first.camera[1], first.camera[2], directions)
    distance = first.distance.reshape(-1)
    seen = distance.isfinite()
    points = centre + distance[seen, None] * world[seen]
    angles, radius = second.camera[:2], second.camera[2]
    rotation, other = cameras.extrinsics(angles[0], angles[1], radius)
    column, row = cameras.project(points, rotation, other)
    place = 2 * torch.stack((column, row), dim=-1) / cameras.IMAGE_SIZE - 1  # of grid_sample, edges of pixels at ±1
    inside = (place.abs() < 1).all(dim=-1)
    nearest = functional.grid_sample(
        second.distance[None, None], place[None, None], mode="nearest", align_corners=False
    )[0, 0, 0]
    both = inside & ((points - other).norm(dim=-1) - nearest < HIDDEN) & nearest.isfinite()
    found = functional.grid_sample(
        second.colours[None], place[None, None, both], mode="bilinear", align_corners=False, padding_mode="border"
    )[0, :, 0]
    own = first.colours.reshape(3, -1)[:, seen][:, both]
    return (own - found).abs().mean(dim=0)


def colour_error(pairs: Sequence[tuple[CameraPicture, CameraPicture]]) -> tuple[float, int]:
    """Mean over all points of all pairs, and their number; NaN where no pair shows a common point."""
    found = torch.cat([colour_differences(first, second) for first, second in pairs])
    return float(found.double().mean()), len(found)

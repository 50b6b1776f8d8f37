"""How far an image lies from the training images, by the shape encoder's features: any object gets a shape otherwise.

The distance is Mahalanobis's, |Fᵀ (f - μ)| with F Fᵀ = (Σ + s D)⁻¹: f the encoder's pooled stages, μ and
Σ of the training images, D the mean variance of each stage, s a share of it, for features that hardly vary. What is
usual is told by the training images themselves. A trial, no command, on 360 validation and test images of a category
and 144 renders of real meshes: at the 99 % point the shipped models call 1 to 2 % of their own category far. The
plane's and the car's model call 98 to 100 % of the others far and 91 to 93 % of meshes of other kinds, the chair's 80 %
of planes, 74 % of cars and 60 % of the meshes.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

PREFIX = "known."  # of the tensors in a model's file
WIDENED = 0.1  # of the mean variance of a stage
UNUSUAL, FAR = 0.9, 0.99  # quantiles from which on an image is called unusual, and none of the kind
_NAMES = ("mean", "factor", "distances")
_GRID = torch.linspace(0, 1, 201, dtype=torch.float64)


def measure(stages: Sequence[Float[Tensor, "m _"]]) -> dict[str, Tensor]:
    """What tells how usual an image is: mean, whitening, quantiles of distances.

    Args:
      stages: features of the training images, of each stage. Of less than two images nothing is usual: no tensors.
    """
    values = torch.cat([features.double().cpu() for features in stages], dim=1)
    if len(values) < 2:
        return {}
    spread = torch.cat([features.double().cpu().var(dim=0).mean().expand(features.shape[1]) for features in stages])
    widened = torch.cov(values.T) + torch.diag(WIDENED * torch.where(spread > 0, spread, 1.0))
    mean, factor = values.mean(dim=0), torch.linalg.cholesky(torch.linalg.inv(widened))
    distances = torch.quantile(((values - mean) @ factor).norm(dim=1), _GRID)
    return {PREFIX + name: value.float() for name, value in zip(_NAMES, (mean, factor, distances), strict=True)}


def quantile(known: Mapping[str, Tensor], features: Float[Tensor, "b f"]) -> Float[np.ndarray, "b"]:
    """The share of training images that lie nearer to their mean than each of these does, 0 to 1.

    Args:
      features: of all stages, one after the other.
    """
    return np.interp(distances(known, features), known[PREFIX + "distances"].double().cpu().numpy(), _GRID.numpy())


def distances(known: Mapping[str, Tensor], features: Float[Tensor, "b f"]) -> Float[np.ndarray, "b"]:
    """As `from_mean`, in double precision."""
    return from_mean(known, features.double().cpu()).numpy()


def from_mean(known: Mapping[str, Tensor], features: Float[Tensor, "b f"]) -> Float[Tensor, "b"]:
    """How far features are from the mean of the training images, whitened; in their type and on their device."""
    mean, factor = (known[PREFIX + name].to(features) for name in _NAMES[:2])
    return ((features - mean) @ factor).norm(dim=1)


def verdict(share: float | None, kind: str) -> str:
    """In words, for a quantile and the kind of object that the model knows."""
    if share is None:
        return "the model does not say what its training images were like"
    if share < FAR:
        return "like the training images" if share < UNUSUAL else "unusual: expect errors"
    return f"no {kind}, to judge by the training images"


def features(known: Mapping[str, Tensor]) -> tuple[Float[Tensor, "f"], Float[Tensor, "f f"]]:
    """Mean and widened covariance Σ + s D of the features of the training images."""
    factor = known[PREFIX + "factor"].double().cpu()
    return known[PREFIX + "mean"].double().cpu(), torch.linalg.inv(factor @ factor.T)


def parted(tensors: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """The weights of a model's file, and what it says of its training images: nothing in older files."""
    known = {name: value for name, value in tensors.items() if name.startswith(PREFIX)}
    weights = {name: value for name, value in tensors.items() if name not in known}
    return weights, known if set(known) == {PREFIX + name for name in _NAMES} else {}

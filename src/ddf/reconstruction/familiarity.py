"""How far an image lies from the training images, by the shape encoder's features: any object gets a shape otherwise.

The distance is that to the nearest training image after whitening: y = Fᵀ (f - μ) with F Fᵀ = (Σ + s I)⁻¹, mean and
covariance of the training features, s a share of the mean variance, for features that hardly vary. What is usual is
told by the training images themselves, each with its nearest of another shape. A trial, no command: at the 99 % point
the shipped models call 1 to 3 % of test images of their own category far. Of the others the plane's and the car's
model call 82 to 96 % far, the chair's 16 % of planes and 43 % of cars.
"""

from collections.abc import Mapping

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

PREFIX = "known."  # of the tensors in a model's file
WIDENED = 0.05  # of the mean variance
FAR = 0.99  # quantile from which on an image is called unlike those of training
MOST = 4096  # images kept, evenly spread over all
_GRID = torch.linspace(0, 1, 201, dtype=torch.float64)


def measure(features: Float[Tensor, "m f"], shapes: Int[np.ndarray, "m"]) -> dict[str, Tensor]:
    """What tells how usual an image is: mean, whitening, whitened features, quantiles of distances.

    Args:
      features: of the training images. shapes: which shape each shows. Of one shape alone nothing is usual: no tensors.
    """
    if len(np.unique(shapes)) < 2:
        return {}
    values = features.double().cpu()
    mean, factor = _whitening(values)
    kept = torch.linspace(0, len(values) - 1, min(MOST, len(values))).round().long()
    whitened, own = (values[kept] - mean) @ factor, torch.from_numpy(shapes)[kept]
    apart = torch.cdist(whitened, whitened).masked_fill(own[:, None] == own, torch.inf).amin(dim=1)
    distances = torch.quantile(apart[apart.isfinite()], _GRID)
    found = {"mean": mean, "factor": factor, "features": whitened, "distances": distances}
    return {PREFIX + name: value.half() if name == "features" else value.float() for name, value in found.items()}


def quantile(known: Mapping[str, Tensor], features: Float[Tensor, "b f"]) -> Float[np.ndarray, "b"]:
    """The share of training images that lie nearer to another shape's than each of these to its nearest, 0 to 1."""
    names = ("mean", "factor", "features", "distances")
    mean, factor, kept, distances = (known[PREFIX + name].double().cpu() for name in names)
    apart = torch.cdist((features.double().cpu() - mean) @ factor, kept).amin(dim=1)
    return np.interp(apart.numpy(), distances.numpy(), _GRID.numpy())


def parted(tensors: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """The weights of a model's file, and what it says of its training images: nothing in older files."""
    known = {name: value for name, value in tensors.items() if name.startswith(PREFIX)}
    return {name: value for name, value in tensors.items() if name not in known}, known


def _whitening(values: Float[Tensor, "m f"]) -> tuple[Float[Tensor, "f"], Float[Tensor, "f f"]]:
    covariance = torch.cov(values.T).reshape(values.shape[1], values.shape[1])
    own = covariance.diagonal().mean()
    widened = covariance + (WIDENED * own if own > 0 else 1.0) * torch.eye(values.shape[1], dtype=values.dtype)
    return values.mean(dim=0), torch.linalg.cholesky(torch.linalg.inv(widened))

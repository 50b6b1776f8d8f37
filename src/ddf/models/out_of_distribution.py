"""Out-of-distribution score of an image: how unlike the training images it is, in the shape encoder's features.

Any picture gets a shape, so a user needs to hear which picture shows no such object. f are the encoder's pooled stages.
The package's models have seen other objects too: their score orders images by -wᵀf, w of a logistic regression that
tells the kind from others (`told_apart`). Other models order them by Mahalanobis's distance, |Fᵀ (f - μ)| with
F Fᵀ = (Σ + s D)⁻¹: μ and Σ are those of the training images, D is the mean variance of each stage, s a share of it, for
features that hardly vary. The score is the share of images of the kind that are less strange.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.core import storage
from ddf.fields import model_files

PREFIX = "known."  # of the tensors in a model's file
WIDENED = 0.1  # of the mean variance of a stage
UNUSUAL, FAR = 0.9, 0.95  # scores from which on an image is called unusual, and none of the kind
_DECAY, _FOLDS = 0.01, 5  # of the regression's squared weights; of the shapes of the kind
_GRID = torch.linspace(0, 1, 201, dtype=torch.float64)


@dataclass(frozen=True)
class TrainingStatistics:
    """Of the features of the training images: mean μ, whitening F, and the distances' quantiles on an even grid.

    direction: w, where others were seen too; likeness: the quantiles of wᵀf of images of the kind.
    """

    mean: Float[Tensor, "f"]
    factor: Float[Tensor, "f f"]
    distances: Float[Tensor, "_"]
    direction: Float[Tensor, "f"] | None = None
    likeness: Float[Tensor, "_"] | None = None

    @classmethod
    def of(cls, stages: Sequence[Float[Tensor, "m _"]]) -> "TrainingStatistics | None":
        """Of the features of each stage; None of less than two images, which say nothing."""
        values = torch.cat([features.double().cpu() for features in stages], dim=1)
        if len(values) < 2:
            return None
        spread = torch.cat([part.double().cpu().var(dim=0).mean().expand(part.shape[1]) for part in stages])
        widened = torch.cov(values.T) + torch.diag(WIDENED * torch.where(spread > 0, spread, 1.0))
        mean, factor = values.mean(dim=0), torch.linalg.cholesky(torch.linalg.inv(widened))
        distances = torch.quantile(((values - mean) @ factor).norm(dim=1), _GRID)
        return cls(mean.float(), factor.float(), distances.float())

    @classmethod
    def read(cls, folder: Path) -> "TrainingStatistics | None":
        """From the file of a folder's model; None where that was written without."""
        return parted(storage.load_tensors(folder / model_files.MODEL, framework="torch")[0])[1]

    def add_to(self, folder: Path) -> None:
        """Put them into the file of a folder's model, beside its weights."""
        path = folder / model_files.MODEL
        tensors, record = storage.load_tensors(path, framework="torch")
        named = {PREFIX + field.name: getattr(self, field.name) for field in fields(self)}
        own = {name: value for name, value in named.items() if value is not None}
        storage.save_tensors(path, parted(tensors)[0] | own, record)

    def distance(self, features: Float[Tensor, "b f"]) -> Float[Tensor, "b"]:
        """Of the features of all stages, one after the other, from the training images' mean, whitened."""
        mean, factor = self.mean.to(features), self.factor.to(features)
        return ((features - mean) @ factor).norm(dim=1)

    def score(self, features: Float[Tensor, "b f"]) -> Float[np.ndarray, "b"]:
        """The share of images of the kind that are less strange than each of these, 0 to 1."""
        if self.direction is not None and self.likeness is not None:
            likeness = (features.double().cpu() @ self.direction.double()).numpy()
            return 1 - np.interp(likeness, self.likeness.double().numpy(), _GRID.numpy())
        found = self.distance(features.double().cpu()).numpy()
        return np.interp(found, self.distances.double().cpu().numpy(), _GRID.numpy())

    def moments(self) -> tuple[Float[Tensor, "f"], Float[Tensor, "f f"]]:
        """Mean and widened covariance Σ + s D, in double precision."""
        factor = self.factor.double().cpu()
        return self.mean.double().cpu(), torch.linalg.inv(factor @ factor.T)


def told_apart(
    own: Float[Tensor, "n f"], others: Float[Tensor, "m f"], shapes: Sequence[str]
) -> tuple[Float[Tensor, "f"], Float[Tensor, "_"]]:
    """Direction w and the quantiles of wᵀf of the kind, each by a regression that has not seen its shape.

    Args:
      own, others: features of images of the kind, and of other objects. shapes: of which each of `own` is one.
    """
    own, others = own.double().cpu(), others.double().cpu()
    spread = torch.cat((own, others)).std(dim=0) + 1e-3
    part = np.unique(shapes, return_inverse=True)[1] % _FOLDS
    held = [own[part == k] @ _regression(own[part != k], others, spread) for k in range(_FOLDS)]
    return _regression(own, others, spread).float(), torch.quantile(torch.cat(held), _GRID).float()


def _regression(own: Float[Tensor, "n f"], others: Float[Tensor, "m f"], spread: Float[Tensor, "f"]) -> Tensor:
    """w of a logistic regression on features over their spread, both kinds of equal weight; its constant is free."""
    weights = torch.zeros(own.shape[1] + 1, dtype=own.dtype, requires_grad=True)
    centred = own - others.mean(0), others - others.mean(0)
    scaled = [functional.pad(each / spread, (0, 1), value=1.0) for each in centred]
    optimiser = torch.optim.LBFGS([weights], max_iter=200, line_search_fn="strong_wolfe")

    def loss() -> Tensor:
        optimiser.zero_grad()
        unlike = (
            functional.softplus(-sign * values @ weights).mean() / 2
            for sign, values in zip((1, -1), scaled, strict=True)
        )
        value = sum(unlike, _DECAY * weights[:-1].square().sum())
        value.backward()
        return value

    optimiser.step(loss)  # pyright: ignore[reportArgumentType]
    return weights.detach()[:-1] / spread


def verdict(score: float | None, kind: str) -> str:
    """A score in words, for the kind of object that the model knows."""
    if score is None:
        return "the model does not say what its training images were like"
    if score < FAR:
        return "like the training images" if score < UNUSUAL else "unusual: expect errors"
    return f"no {kind}, to judge by the training images"


def parted(tensors: Mapping[str, Tensor]) -> tuple[dict[str, Tensor], TrainingStatistics | None]:
    """The weights of a model's file, and what it says of its training images: None in older files."""
    found = {name.removeprefix(PREFIX): value for name, value in tensors.items() if name.startswith(PREFIX)}
    weights = {name: value for name, value in tensors.items() if not name.startswith(PREFIX)}
    known = {field.name for field in fields(TrainingStatistics)}
    complete = {"mean", "factor", "distances"} <= set(found) <= known
    return weights, TrainingStatistics(**found) if complete else None

"""How latents of a model vary between objects: what a shape is like before anything was seen of it."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import checks
from ddf.models import out_of_distribution, reconstruction_models


@dataclass(frozen=True)
class LatentPrior:
    """z = mean + basis u with u ~ N(0, I). basis: principal axes, the widest first, each of its deviation's length."""

    mean: Float[Tensor, "z"]
    basis: Float[Tensor, "z k"]

    def latents(self, u: Float[Tensor, "*b k"]) -> Float[Tensor, "*b z"]:
        """z of coordinates u."""
        return self.mean + u @ self.basis.T

    def coordinates(self, latents: Float[Tensor, "*b z"]) -> Float[Tensor, "*b k"]:
        """u of latents: the nearest in the span of the axes."""
        return (latents - self.mean) @ self.basis / self.basis.square().sum(0)


@torch.no_grad()
def of(
    model: reconstruction_models.DDFModel, statistics: out_of_distribution.TrainingStatistics | None, axes: int
) -> LatentPrior:
    """From the statistics of the training images: the shape latent is linear in their pooled features.

    Raises:
      InputError: there are none.
    """
    if statistics is None:
        raise checks.InputError(
            "this model does not say what its training images were like; give one that stage train_ddf writes today"
        )
    last = model.shape_encoder.fc
    mean, covariance = statistics.moments()
    weight, width = last.weight.double().cpu(), last.in_features
    centre = weight @ mean[-width:] + last.bias.double().cpu()
    return of_moments(centre.to(last.weight), weight @ covariance[-width:, -width:] @ weight.T, axes)


def of_moments(mean: Float[Tensor, "z"], covariance: Float[Tensor, "z z"], axes: int) -> LatentPrior:
    """The principal axes of a covariance, as exact as that; the basis is of the mean's kind."""
    values, vectors = torch.linalg.eigh(covariance)
    return LatentPrior(mean, (vectors * values.clamp_min(0).sqrt()).flip(-1)[:, :axes].to(mean))

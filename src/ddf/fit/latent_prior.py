"""How latents of a model vary between objects: what a shape is like before anything was seen of it.

A model that has no latents, of stage train_ddf_image, may have `SHAPES` beside it: decoder and prior of one that has.
"""

import dataclasses
import functools
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import torch
from jaxtyping import Float
from torch import Tensor

from ddf.core import checks, storage
from ddf.fields import framed_field, model_files, pddf
from ddf.models import out_of_distribution, reconstruction_models, reconstruction_settings

SHAPES, KIND, PREFIX = "shapes.safetensors", "latent_shapes", "prior."  # PREFIX: of the prior's tensors


@dataclass(frozen=True)
class LatentPrior:
    """z = mean + basis u with u ~ N(0, I). basis: principal axes, the widest first, each of its deviation's length."""

    mean: Float[Tensor, "z"]
    basis: Float[Tensor, "z k"]

    def latents(self, u: Float[Tensor, "*b k"]) -> Float[Tensor, "*b z"]:
        """z of coordinates u."""
        return self.mean + u @ self.basis.T

    def widest(self, axes: int) -> "LatentPrior":
        """With so many axes."""
        return LatentPrior(self.mean, self.basis[:, :axes])

    def coordinates(self, latents: Float[Tensor, "*b z"]) -> Float[Tensor, "*b k"]:
        """u of latents: the nearest in the span of the axes."""
        return (latents - self.mean) @ self.basis / self.basis.square().sum(0)


@torch.no_grad()
def of(model: reconstruction_models.DDFModel, statistics: out_of_distribution.TrainingStatistics | None) -> LatentPrior:
    """From the statistics of the training images: the shape latent is linear in their pooled features. InputError where
    there are none.
    """
    if statistics is None:
        raise checks.InputError(
            "this model does not say what its training images were like; give one that stage train_ddf writes today"
        )
    last = model.shape_encoder.fc
    mean, covariance = statistics.moments()
    weight, width = last.weight.double().cpu(), last.in_features
    centre = weight @ mean[-width:] + last.bias.double().cpu()
    return of_moments(centre.to(last.weight), weight @ covariance[-width:, -width:] @ weight.T)


def of_moments(mean: Float[Tensor, "z"], covariance: Float[Tensor, "z z"]) -> LatentPrior:
    """The principal axes of a covariance, as exact as that; the basis is of the mean's kind."""
    values, vectors = torch.linalg.eigh(covariance)
    return LatentPrior(mean, (vectors * values.clamp_min(0).sqrt()).flip(-1).to(mean))


class LatentShapes(NamedTuple):
    """Latents to shapes, on the CPU: a step is small, and a GPU would be waited for. encoder: the model of images that
    has this decoder, where the file holds one.
    """

    decoder: pddf.ConditionalPDDF
    prior: LatentPrior
    encoder: reconstruction_models.TrainedDDF | None


def load(folder: Path) -> LatentShapes:
    """Of a model's folder: of `SHAPES` where that is there, else of its DDF; errors are those of `load_ddf`."""
    if not (folder / SHAPES).exists():
        trained = reconstruction_models.load_ddf(folder)
        trained.network.cpu().requires_grad_(False)
        return LatentShapes(trained.network.decoder, of(trained.network, trained.statistics), trained)
    from ddf.core import config

    tensors, record = storage.load_tensors(folder / SHAPES, framework="torch")
    with framed_field.record_of(folder):
        field = config.recorded(record["field"], reconstruction_settings.FieldConfig, "ddf.field")
        train = config.recorded(record["train"], reconstruction_settings.TrainConfig, "train")
        prior = LatentPrior(*(tensors[PREFIX + part.name] for part in dataclasses.fields(LatentPrior)))
    make = functools.partial(pddf.ConditionalPDDF, field.of(train.decoder), train.latent_features)
    decoder = model_files.built(make, folder, PREFIX, SHAPES).cpu().requires_grad_(False)
    return LatentShapes(decoder, prior, None)


def write(folder: Path, out: Path) -> None:
    """Decoder and prior of a folder's DDF as `SHAPES` in another folder."""
    shapes, record = load(folder), storage.load_metadata(folder / model_files.MODEL)
    parts = {PREFIX + part.name: getattr(shapes.prior, part.name) for part in dataclasses.fields(LatentPrior)}
    kept = ("fingerprint", "seed", "sources", "steps", "train", "format_version", "packages")
    tensors = model_files.rounded(shapes.decoder.state_dict()) | parts
    of_file = {name: record[name] for name in kept} | {"kind": KIND, "field": record["section"]["field"]}
    storage.save_tensors(out / SHAPES, tensors, of_file)

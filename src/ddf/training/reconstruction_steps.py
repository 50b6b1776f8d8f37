"""One optimisation step of single-image reconstruction, for the DDF model and for PC-SIREN. [DDF22] §4.3, app. E."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.core import arrays
from ddf.data.batches import category_data
from ddf.fields import losses, model_files
from ddf.geometry import cameras
from ddf.models import reconstruction_models, reconstruction_settings
from ddf.training import proposed_rays

GROUP = 32  # distances of which the least is found first, at most


@dataclass(frozen=True)
class Batch:
    """Images of one step with the cameras and shapes that they show; everything on the model's device."""

    rows: np.ndarray
    shapes: np.ndarray
    images: Float[Tensor, "b 4 size size"]
    cameras: Float[Tensor, "b 3"]
    random: np.random.Generator

    @classmethod
    def draw(cls, images: category_data.ImageSet, config: reconstruction_settings.TrainConfig, step: int) -> "Batch":
        """Random images of step `step`, without repetition as long as there are enough."""
        random = np.random.default_rng((config.loop.seed, step))
        repeated = len(images.shapes) < config.batch_size
        rows = random.choice(len(images.shapes), config.batch_size, replace=repeated)
        place = model_files.device()
        shown = arrays.send(images.batch(rows), place)
        poses = arrays.send(images.cameras_of(rows), place)
        return cls(rows, images.shapes[rows], shown, poses, random)

    def chances(self, count: int) -> Float[Tensor, "b count"]:
        """Random numbers in [0, 1) for each image: the same on every device."""
        generator = torch.Generator().manual_seed(int(self.random.integers(2**62)))
        return arrays.send(torch.rand((len(self.shapes), count), generator=generator), self.images.device)


def ddf_step(
    model: reconstruction_models.DDFModel,
    images: category_data.ImageSet,
    shapes: category_data.ShapeSet,
    samples: category_data.SampleSet,
    train: reconstruction_settings.TrainConfig,
    config: reconstruction_settings.DDFConfig,
    step: int,
    propose: proposed_rays.Proposer | None = None,
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """𝔏_S + γ_RΠ L_Π + γ_RM L_M, the mask with the predicted camera and the true scale."""
    batch = Batch.draw(images, train, step)
    place = batch.images.device
    modulations = model.modulations(model.shape_encoder(batch.images))
    points = samples.draw(batch.shapes, config.counts, batch.random).to(place)
    if propose is not None:
        points = propose(points, model.field, modulations, batch.shapes, batch.random)
    shape_loss, terms = losses.shape_loss(model.field, points, modulations, config.weights)
    from_cameras, seen_from = camera_loss(model, batch, train)
    mask_loss = reconstruction_models.mask_loss(
        model.field,
        modulations,
        seen_from,
        arrays.send(shapes.field_scales(batch.shapes), place),
        category_data.averaged(batch.images[:, 3], config.mask_size),
        config.mask_pixels,
        None if config.mask_pixels is None else batch.chances(config.mask_size**2),
        arrays.send(shapes.field_shifts(batch.shapes), place),
    ).mean()
    total = shape_loss + reconstruction_settings.CAMERA_WEIGHT * from_cameras + config.mask_weight * mask_loss
    return total, {**terms, "camera": from_cameras.detach(), "mask": mask_loss.detach()}


def camera_loss(
    model: reconstruction_models.ReconstructionModel, batch: Batch, train: reconstruction_settings.TrainConfig
) -> tuple[Float[Tensor, ""], Float[Tensor, "b 3"]]:
    """L_Π and the predicted cameras of the images as they are; with `train.told` half of them are shown mirrored."""
    if not train.told:
        scores = model.camera_encoder(batch.images)
        return model.camera_head.loss(scores, batch.cameras), model.camera_head(scores)
    turned = batch.chances(1) < 0.5

    def as_shown(camera: Float[Tensor, "b 3"]) -> Float[Tensor, "b 3"]:
        return torch.where(turned, cameras.mirrored(camera), camera)

    scores = model.camera_encoder(torch.where(turned[..., None, None], batch.images.flip(-1), batch.images))
    return model.camera_head.loss(scores, as_shown(batch.cameras)), as_shown(model.camera_head(scores))


def pcsiren_step(
    model: reconstruction_models.PCSirenModel,
    images: category_data.ImageSet,
    shapes: category_data.ShapeSet,
    train: reconstruction_settings.TrainConfig,
    config: reconstruction_settings.PCSirenConfig,
    step: int,
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """D_C in the field frame + γ_RΠ L_Π."""
    batch = Batch.draw(images, train, step)
    place = batch.images.device
    truth = arrays.send(shapes.subsets(batch.shapes, config.truth_points, batch.random), place)
    seeds = batch.random.uniform(-1, 1, (len(batch.shapes), config.points, 3)).astype(np.float32)
    predicted = model.decoder(arrays.send(seeds, place), model.shape_encoder(batch.images))
    chamfer = chamfer_loss(predicted, truth)
    from_cameras, _ = camera_loss(model, batch, train)
    total = chamfer + reconstruction_settings.CAMERA_WEIGHT * from_cameras
    return total, {"chamfer": chamfer.detach(), "camera": from_cameras.detach()}


def chamfer_loss(predicted: Float[Tensor, "b n 3"], truth: Float[Tensor, "b m 3"]) -> Float[Tensor, ""]:
    """D_C: sum of the two means of squared distances to the nearest neighbour, mean over shapes.

    The neighbours are found without gradient; only the pairs that count are differentiated.
    """
    to_truth, to_predicted = _nearest(predicted.detach(), truth)
    near_truth = truth.gather(1, to_truth[..., None].expand(-1, -1, 3))
    near_predicted = predicted.gather(1, to_predicted[..., None].expand(-1, -1, 3))
    there = (predicted - near_truth).square().sum(-1).mean()
    return there + (truth - near_predicted).square().sum(-1).mean()


def _nearest(
    predicted: Float[Tensor, "b n 3"], truth: Float[Tensor, "b m 3"]
) -> tuple[Int[Tensor, "b n"], Int[Tensor, "b m"]]:
    """Index of the nearest true point of each predicted one, and the other way round, in blocks that stay in cache."""
    n, m = predicted.shape[1], truth.shape[1]
    block = losses.block_values(predicted.device)
    shapes, columns = max(1, block // (n * m)), max(1, block // n)
    to_truth, to_predicted = [], []
    for own, others in zip(predicted.split(shapes), truth.split(shapes), strict=True):
        nearest = torch.full(own.shape[:2], torch.inf, dtype=own.dtype, device=own.device)
        index = torch.zeros(own.shape[:2], dtype=torch.int64, device=own.device)
        back, start = [], 0
        for part in others.split(columns, dim=1):
            dist_sq = torch.baddbmm(
                own.square().sum(-1, keepdim=True) + part.square().sum(-1)[:, None], own, part.mT, alpha=-2
            )
            back.append(_argmin(dist_sq, 1)[1])
            least, place = _argmin(dist_sq, 2)
            index = torch.where(least < nearest, place + start, index)
            nearest = torch.minimum(least, nearest)
            start += part.shape[1]
        to_truth.append(index)
        to_predicted.append(torch.cat(back, dim=1))
    return torch.cat(to_truth), torch.cat(to_predicted)


def _argmin(values: Float[Tensor, "b n m"], dim: int) -> tuple[Float[Tensor, "b _"], Int[Tensor, "b _"]]:
    """The least along an axis and its index, the first of several: of groups first, as values alone are found some
    seven times as fast as with their index.
    """
    size = math.gcd(values.shape[dim], GROUP)
    groups = values.unflatten(dim, (-1, size))
    chosen = groups.amin(dim + 1).argmin(dim).unsqueeze(dim)
    least, place = groups.take_along_dim(chosen.unsqueeze(dim + 1), dim).min(dim + 1)
    return least.squeeze(dim), (chosen * size + place).squeeze(dim)

"""Single-image 3D reconstruction: the two models, their mask loss, and their files. [DDF22] §4.3, app. E.

An RGBA image goes to a shape latent z_s and to a camera (azimuth, elevation, radius); a conditional PDDF or PC-SIREN
turns z_s into a shape. Cameras are (..., 3): azimuth and elevation in radians, radius in benchmark units.
"""

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional

from ddf.core import checks, storage
from ddf.data.batches import category_data
from ddf.fields import framed_field, model_files, passes, pddf, rendering
from ddf.geometry import cameras
from ddf.models import camera_encoder, encoders, out_of_distribution, reconstruction_settings

MOST_MASKS = 1000  # of the training set, whose statistics are taken
# Images at a time; the networks are in evaluation mode, so the sizes matter to the result by rounding alone.
ENCODER_BATCH = 64
NAMES = {"ddf": "DDF", "pcsiren": "PC-SIREN", "ddf_image": "image-feature DDF"}  # of kinds of models
LOG_OF_ZERO = -100.0  # where `torch.nn.functional.binary_cross_entropy` bounds a logarithm

Rows = Int[np.ndarray, "_"]  # of images
Stages = tuple[Float[Tensor, "n _"], ...]


class ReconstructionModel(nn.Module):
    """Two encoders and a decoder. Parameters at the paper's sizes: 25,647,367 (DDF) and 25,645,574 (PC-SIREN)."""

    def __init__(self, decoder: nn.Module, train: reconstruction_settings.TrainConfig) -> None:
        super().__init__()
        make, width = encoders.ENCODERS[train.encoder], train.encoder_width
        self.camera_head = camera_encoder.CameraHead(train.azimuth)
        self.shape_encoder = self.encoder_of(train)
        scores = self.camera_head.num_scores
        self.camera_encoder: nn.Module = (
            camera_encoder.StatisticsAwareEncoder(make, scores, width) if train.told else make(scores, width)
        )
        self.decoder = decoder

    @staticmethod
    def encoder_of(train: reconstruction_settings.TrainConfig) -> encoders.Encoder:
        """The encoder of shapes, not trained yet."""
        return encoders.ENCODERS[train.encoder](train.latent_features, train.encoder_width)

    def fit_cameras(self, images: category_data.ImageSet) -> None:
        """Take the statistics of cameras and masks from the training images; errors are those of `CameraHead.fit`."""
        self.camera_head.fit(images.cameras)
        if isinstance(self.camera_encoder, camera_encoder.StatisticsAwareEncoder):
            rows = np.linspace(0, len(images.shapes) - 1, min(MOST_MASKS, len(images.shapes))).round().astype(int)
            self.camera_encoder.fit(images.batch(rows)[:, 3], images.cameras[:, 2])

    def parameter_groups(self, encoder_share: float = 1.0) -> list[dict]:
        """AdamW groups: decay on the two predictors, none on the decoder. Source: [DDF22] app. E.

        Args:
          encoder_share: the predictors' learning rate as a share of the decoder's; 1 is the paper's way.
        """
        shape, camera = reconstruction_settings.WEIGHT_DECAY_SHAPE, reconstruction_settings.WEIGHT_DECAY_CAMERA
        return [
            {"params": list(self.shape_encoder.parameters()), "weight_decay": shape, "share": encoder_share},
            {"params": list(self.camera_encoder.parameters()), "weight_decay": camera, "share": encoder_share},
            {"params": list(self.decoder.parameters()), "weight_decay": 0.0},
        ]


class DDFModel(ReconstructionModel):
    """Single-image reconstruction with the conditional probabilistic DDF."""

    decoder: pddf.ConditionalPDDF

    def __init__(self, train: reconstruction_settings.TrainConfig, field: reconstruction_settings.FieldConfig) -> None:
        super().__init__(pddf.ConditionalPDDF(field.of(train.decoder), train.latent_features), train)

    @property
    def field(self) -> pddf.PDDF:
        """The field that the modulations of `modulations` condition."""
        return self.decoder.field

    def modulations(self, latent: Float[Tensor, "*b z"]) -> list[Float[Tensor, "*b 1 _"]]:
        """One modulation per sine layer and shape."""
        return self.decoder.modulations(latent)


class PCSirenModel(ReconstructionModel):
    """Single-image reconstruction with the PC-SIREN baseline."""

    decoder: pddf.PointDecoder

    def __init__(self, train: reconstruction_settings.TrainConfig) -> None:
        super().__init__(pddf.PointDecoder(train.decoder, train.latent_features), train)


def mask_loss(
    field: pddf.PDDF,
    modulations: Sequence[Float[Tensor, "b 1 _"]],
    camera: Float[Tensor, "b 3"],
    field_scale: Float[Tensor, "b"],
    alpha: Float[Tensor, "b size size"],
    num_pixels: int | None = None,
    chances: Float[Tensor, "b pixels"] | None = None,
    field_shift: Float[Tensor, "b 3"] | None = None,
) -> Float[Tensor, "b"]:
    """L_M per image: BCE of the alpha channel and the rendered visibility, mean over all pixels. Source: [DDF22] §4.3.

    Only pixels whose ray meets the cube are evaluated; with `num_pixels`, a random subset of those, scaled by the share
    of the image that they stand for: the ones with the largest `chances`, in [0, 1). The others render 0 whatever the
    field, and cost -log 0, taken as `LOG_OF_ZERO`, times their alpha: no query, no gradient.

    Args:
      field_shift: where the origin of v1 lies in the field frame, see `rendering.field_rays`.
    """
    size = alpha.shape[-1]
    directions = cameras.pixel_directions(size, alpha).reshape(-1, 3)
    with torch.no_grad():
        meets = rendering.field_rays(camera, field_scale, directions, field_shift)[3]
        chosen = _choose(meets, num_pixels, chances)
    entry, world, _, chosen_meets = rendering.field_rays(camera, field_scale, directions[chosen], field_shift)
    raw = passes.compiled_raw(field, entry, world, modulations)
    wanted = alpha.flatten(-2)
    target = wanted.gather(1, chosen)
    bce = functional.binary_cross_entropy_with_logits(raw[..., pddf.VISIBILITY_ROW], target, reduction="none")
    weight = chosen_meets.to(bce.dtype)
    met = (bce * weight).sum(-1) / weight.sum(-1).clamp_min(1) * meets.to(bce.dtype).mean(-1)
    return met - LOG_OF_ZERO * wanted.masked_fill(meets, 0.0).mean(-1)


def _choose(meets: Bool[Tensor, "b n"], num_pixels: int | None, chances: Float[Tensor, "b n"] | None) -> Tensor:
    """Indices of pixels that meet the box, random where there are more than `num_pixels`; padded with misses.

    A CPU leaves out what would pad every image; a GPU would be waited for, which takes longer than these queries.
    """
    most = int(meets.sum(-1).max()) if meets.device.type == "cpu" else meets.shape[-1]
    count = max(1, most if num_pixels is None else min(num_pixels, most))
    order = meets.to(torch.float32)
    if num_pixels is not None:
        if chances is None:
            raise ValueError("num_pixels needs chances, by which they are chosen")
        order = order * (1 + chances)
    return order.topk(count, dim=-1).indices


def row_batches(images: category_data.ImageSet, size: int = ENCODER_BATCH) -> list[Rows]:
    """Rows of at most so many images at a time."""
    count = len(images.shapes)
    return np.array_split(np.arange(count), -(-count // size))


@torch.no_grad()
def encode_batch(
    model: ReconstructionModel, batch: Float[Tensor, "n 4 s s"]
) -> tuple[Stages, Float[Tensor, "n z"], Float[Tensor, "n 3"]]:
    """Features of the shape encoder's stages, shape latents and predicted cameras of some images."""
    stages = model.shape_encoder.stages(batch)
    return stages, model.shape_encoder.fc(stages[-1]), model.camera_head(model.camera_encoder(batch))


def encode(
    model: ReconstructionModel, images: category_data.ImageSet
) -> tuple[Float[Tensor, "n features"], Float[Tensor, "n z"], Float[Tensor, "n 3"]]:
    """Features of the last stage, latents and cameras of all images."""
    batches = (images.batch(rows).to(model_files.device()) for rows in row_batches(images))
    stages, latents, found = zip(*(encode_batch(model, batch) for batch in batches), strict=True)
    return torch.cat([each[-1] for each in stages]), torch.cat(latents), torch.cat(found)


@torch.no_grad()
def image_stages(model: ReconstructionModel, images: category_data.ImageSet) -> Stages:
    """Features of all stages, which `out_of_distribution` compares."""
    batches = (images.batch(rows).to(model_files.device()) for rows in row_batches(images))
    found = (model.shape_encoder.stages(batch) for batch in batches)
    return tuple(torch.cat(stage).cpu() for stage in zip(*found, strict=True))


class TrainedDDF(NamedTuple):
    """A DDF model in evaluation mode, the image size that it takes, and the statistics of its training images."""

    network: DDFModel
    image_size: int
    statistics: out_of_distribution.TrainingStatistics | None


def load_ddf(folder: Path) -> TrainedDDF:
    """The DDF model of a folder, or of its file.

    Of the section `ddf` of its record the field alone is read: how it was trained may be said in other words by now.
    """
    folder, train, section = recorded(folder, "ddf")
    from ddf.core import config  # needs yaml, which training and inference do without

    with framed_field.record_of(folder):
        field = config.recorded(section["field"], reconstruction_settings.FieldConfig, "ddf.field")
    network = model_files.built(functools.partial(DDFModel, train, field), folder, out_of_distribution.PREFIX)
    return TrainedDDF(network, train.image_size, out_of_distribution.TrainingStatistics.read(folder))


def load_pcsiren(folder: Path) -> tuple[PCSirenModel, int]:
    """The PC-SIREN model of a folder, and its image size; errors are those of `load_ddf`."""
    folder, train, _ = recorded(folder, "pcsiren")
    return model_files.built(functools.partial(PCSirenModel, train), folder), train.image_size


def recorded(folder: Path, kind: str) -> tuple[Path, reconstruction_settings.TrainConfig, Mapping[str, Any]]:
    """The folder of a model, and the sections of its record that it is built by; errors are those of `load_ddf`."""
    from ddf.core import config

    folder = folder.parent if folder.name == model_files.MODEL else folder
    record = storage.load_metadata(folder / model_files.MODEL)
    if record.get("kind") != kind:
        raise checks.InputError(
            f"{folder}: holds no {NAMES[kind]} model; give a folder that `make train` wrote under train_{kind}/"
        )
    with framed_field.record_of(folder):
        return folder, config.recorded(record["train"], reconstruction_settings.TrainConfig, "train"), record["section"]

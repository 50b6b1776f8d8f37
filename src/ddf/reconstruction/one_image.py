"""One image to camera, shape and cloud by a trained DDF: what `ddf reconstruct` and `ddf.reconstruct` share."""

import contextlib
import dataclasses
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from ddf.core import checks, storage
from ddf.data.batches import category_data
from ddf.fields import cloud_projection, model_files, pddf, shape_field, stored_fields
from ddf.models import out_of_distribution, reconstruction_models, reconstruction_settings
from ddf.reconstruction import framing, many_images, mask_descent

VIEW = 274  # pixels a side of the framed object, whose colours are kept
WHOLE = 5000  # points at least whose box gives the shape its scale and its place
_MARGIN = 0.05  # field units, between the cloud and the field's box
CAMERA = reconstruction_settings.CorrectionConfig(30, 0.05, 32, ("azimuth",))  # as configs/cpu.yaml has it
CLOUDS = "ddf.safetensors"  # in the folder of stage `pointclouds`


@dataclass(frozen=True)
class Reconstructed:
    """What the model makes of an image.

    camera: azimuth and elevation (radians) and radius (benchmark units), predicted; then the azimuth turned until the
    silhouette agrees. modulations: of the field. whole: its cloud of `WHOLE` points or more, field frame, in an order
    of which every first part is a cloud too. scale: v1 units per field unit, estimated from its box. view: the object
    as it was framed, which the camera sees. score: how far that lies from the training images
    (`out_of_distribution`); None where the model's file does not say. seconds: of each part.
    """

    camera: Float[Tensor, "3"]
    modulations: list[Float[Tensor, "1 _"]]
    whole: Float[Tensor, "n 3"]
    scale: float
    view: UInt8[np.ndarray, "s s 4"]
    score: float | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    def shape(self, model: reconstruction_models.DDFModel) -> shape_field.ShapeField:
        """The field, frame of v1; its box is the cloud's with a margin."""
        return placed(model, self.modulations, self.whole, self.scale)


def placed(
    model: reconstruction_models.DDFModel,
    modulations: Sequence[Float[Tensor, "1 _"]],
    cloud: Float[Tensor, "n 3"],
    scale: float,
) -> shape_field.ShapeField:
    """The field of one shape, frame of v1; its box is that of the cloud with a margin."""
    whole = shape_field.conditioned(pddf.baked(model.field, modulations), None, scale)
    points = cloud.double().cpu().numpy()
    lower = np.clip(points.min(axis=0) - _MARGIN, whole.lower, whole.upper - _MARGIN)
    upper = np.clip(points.max(axis=0) + _MARGIN, lower + _MARGIN, whole.upper)
    return dataclasses.replace(whole, lower=lower, upper=upper)


def load(folder: Path) -> tuple[reconstruction_models.DDFModel, int]:
    """A trained DDF model, by its folder or file, and the image size that it takes, from the record inside its file.

    Raises:
      FileNotFoundError: there is no model. InputError: it is damaged, or of another kind.
    """
    folder = folder.parent if folder.name == model_files.MODEL else folder
    record = storage.load_metadata(folder / model_files.MODEL)
    if record.get("kind") != "ddf":
        raise checks.InputError(f"{folder}: holds no DDF model; give a folder that `make train` wrote under train_ddf/")
    return reconstruction_models.load_ddf(folder, record)


def latent_deviation(model: reconstruction_models.DDFModel, folder: Path, encoded: Path) -> Float[Tensor, "z"]:
    """How latents of the model vary between the training images that stage `pointclouds` encoded.

    Args:
      folder: of the model, or its file. encoded: folder of the stage for the category, or its file of clouds.
    Raises:
      FileNotFoundError: no such file. InputError: it is damaged, or was made with another model.
    """
    folder = folder.parent if folder.name == model_files.MODEL else folder
    file = encoded / CLOUDS if encoded.is_dir() else encoded
    tensors, record = storage.load_tensors(file, "torch")
    made_with = storage.checksum(folder / model_files.MODEL)
    if made_with not in record.get("sources", {}).values() or "train_features" not in tensors:
        raise checks.InputError(f"{file}: was not made with the model in {folder}; run stage pointclouds on it")
    return mask_descent.latent_deviation(model, tensors["train_features"])


def reconstruct(
    model: reconstruction_models.DDFModel,
    image_size: int,
    pixels: UInt8[np.ndarray, "h w 4"],
    points: int,
    seed: int = 0,
    deviation: Float[Tensor, "z"] | None = None,
    statistics: out_of_distribution.TrainingStatistics | None = None,
) -> Reconstructed:
    """Frame the object, encode, move the shape towards its silhouette where `deviation` is given, draw the cloud, turn
    the camera until the cloud's field has that silhouette.

    Args:
      pixels: of `cutouts.read`. points: that the cloud must have, 2 or more. deviation: of `latent_deviation`.
      statistics: of the training images.
    Raises:
      InputError: fewer than 2 points.
    """
    if points < 2:
        raise checks.InputError(f"the number of points must be >= 2; got {points}")
    seconds: dict[str, float] = {}
    cutout = framing.Cutout(pixels)
    with _timed(seconds, "framing"):
        frame = framing.frame(model, statistics, cutout, image_size)
        framed = framing.encoder_input(cutout.crop(frame, image_size)).to(model_files.device())
    with _timed(seconds, "encoders"), torch.no_grad():
        stages, latent, seen_from = reconstruction_models.encode_batch(model, framed)
    score = None if statistics is None else float(statistics.score(torch.cat(stages, dim=1))[0])
    drawn = stored_fields.cloud_config()
    if deviation is not None:
        with _timed(seconds, "silhouette"):
            how = reconstruction_settings.ShapeCorrectionConfig()
            field_scale = many_images.rough_field_scales(model, latent, drawn, [_generator(seed)])
            alpha = category_data.averaged(framed[:, 3], how.mask_size)
            latent = mask_descent.correct_shapes(model, latent, deviation, seen_from, field_scale, alpha, how)
    batch = [each.detach() for each in model.modulations(latent)]
    modulations = [each[0] for each in batch]
    with _timed(seconds, "cloud"):
        whole = cloud_projection.draw(model.field, modulations, max(points, WHOLE), drawn, _generator(seed))
    scale = mask_descent.scale_from_cloud(whole)
    with _timed(seconds, "camera"):
        alpha = category_data.averaged(framed[:, 3], CAMERA.mask_size)
        field_scale = 1 / seen_from.new_tensor([scale])
        seen_from = mask_descent.correct_camera(model, batch, seen_from, field_scale, alpha, CAMERA)
        seen_from[:, 0] %= 2 * math.pi
    view = cutout.crop(frame, VIEW)
    return Reconstructed(seen_from[0], modulations, whole, scale, view, score, seconds)


@torch.no_grad()
def latent(
    model: reconstruction_models.DDFModel,
    image_size: int,
    pixels: UInt8[np.ndarray, "h w 4"],
    statistics: out_of_distribution.TrainingStatistics | None = None,
) -> Float[Tensor, "z"]:
    """What the shape encoder makes of a picture, framed; arguments as of `reconstruct`."""
    cutout = framing.Cutout(pixels)
    framed = framing.encoder_input(cutout.crop(framing.frame(model, statistics, cutout, image_size), image_size))
    return reconstruction_models.encode_batch(model, framed.to(model.shape_encoder.fc.weight))[1][0]


def _generator(seed: int) -> torch.Generator:
    return torch.Generator(model_files.device()).manual_seed(seed)


@contextlib.contextmanager
def _timed(table: dict[str, float], name: str) -> Iterator[None]:
    """Note the wall time of a block in a table."""
    started = time.monotonic()
    yield
    table[name] = time.monotonic() - started

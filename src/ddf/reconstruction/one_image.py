"""One image to camera, shape and cloud by a trained DDF: what `ddf reconstruct` and `ddf.reconstruct` share."""

import contextlib
import dataclasses
import logging
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from ddf.data.batches import category_data
from ddf.fields import cloud_projection, framed_field, model_files, pddf, shape_field
from ddf.models import reconstruction_models, reconstruction_settings
from ddf.reconstruction import framing, mask_descent

LOGGER = logging.getLogger(__name__)
VIEW = 274  # pixels a side of the framed object, whose colours are kept
WHOLE = 5000  # points at least whose box gives the shape its scale and its place
_MARGIN = 0.05  # field units, between the cloud and the field's box
CAMERA = reconstruction_settings.CorrectionConfig(30, 0.05, 32, ("azimuth",))  # as configs/cpu.yaml has it


@dataclass(frozen=True)
class Reconstructed:
    """What the model makes of an image.

    shape: the field, frame of v1; its box is that of its cloud with a margin. cloud: `WHOLE` points or more, frame of
    v1, in an order of which every first part is a cloud too. cameras: azimuth and elevation (radians) and radius
    (benchmark units) of each picture, predicted; then the azimuth turned until the silhouette agrees. view: the object
    as it was framed, which the first camera sees. scores: how far each picture lies from the training images
    (`out_of_distribution`); None where the model's file does not say. seconds: of each part.
    """

    shape: framed_field.FramedField
    cloud: Float[np.ndarray, "n 3"]
    cameras: Float[Tensor, "k 3"]
    view: UInt8[np.ndarray, "s s 4"]
    scores: Sequence[float | None]
    seconds: dict[str, float]


def placed(
    field: pddf.PDDF, modulations: Sequence[Float[Tensor, "1 _"]], cloud: Float[Tensor, "n 3"], scale: float
) -> shape_field.ShapeField:
    """The field of one shape, frame of v1; its box is that of the cloud with a margin."""
    whole = shape_field.in_cube(pddf.baked(field, modulations), scale)
    lower, upper = box_of(cloud, whole.lower, whole.upper)
    return dataclasses.replace(whole, lower=lower, upper=upper)


def box_of(
    cloud: Float[Tensor, "n 3"], least: Float[np.ndarray, "3"], most: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Corners of the box of a cloud with a margin, within another box."""
    points = cloud.double().cpu().numpy()
    lower = np.clip(points.min(axis=0) - _MARGIN, least, most - _MARGIN)
    return lower, np.clip(points.max(axis=0) + _MARGIN, lower + _MARGIN, most)


def reconstruct(
    trained: reconstruction_models.TrainedDDF, pixels: UInt8[np.ndarray, "h w 4"], points: int, seed: int = 0
) -> Reconstructed:
    """Frame the object, encode, draw the cloud, turn the camera until the cloud's field has the object's silhouette.

    Args:
      pixels: of `cutouts.read`. points: that the cloud must have, 2 or more.
    """
    model, image_size, statistics = trained
    seconds: dict[str, float] = {}
    cutout = framing.Cutout(pixels)
    with timed(seconds, "framing"):
        frame = framing.frame(trained, cutout)
        framed = framing.encoder_input(cutout.crop(frame, image_size)).to(model_files.device())
    with timed(seconds, "encoders"), torch.no_grad():
        stages, latent, seen_from = reconstruction_models.encode_batch(model, framed)
    scores = [None] if statistics is None else statistics.score(torch.cat(stages, dim=1)).tolist()
    drawn = cloud_projection.USUAL
    batch = [each.detach() for each in model.modulations(latent)]
    modulations = [each[0] for each in batch]
    with timed(seconds, "cloud"):
        whole = cloud_projection.draw(model.field, modulations, max(points, WHOLE), drawn, seeded(seed))
    scale = mask_descent.scale_from_cloud(whole)
    with timed(seconds, "camera"):
        alpha = category_data.averaged(framed[:, 3], CAMERA.mask_size)
        field_scale = 1 / seen_from.new_tensor([scale])
        seen_from = mask_descent.correct_camera(model, batch, seen_from, field_scale, alpha, CAMERA)
        seen_from[:, 0] %= 2 * math.pi
    shape, cloud = placed(model.field, modulations, whole, scale), scale * whole.double().cpu().numpy()
    return Reconstructed(shape, cloud, seen_from, cutout.crop(frame, VIEW), scores, seconds)


@torch.no_grad()
def latent(trained: reconstruction_models.TrainedDDF, pixels: UInt8[np.ndarray, "h w 4"]) -> Float[Tensor, "z"]:
    """What the shape encoder makes of a picture, framed; the pixels are those of `cutouts.read`."""
    cutout, network = framing.Cutout(pixels), trained.network
    framed = framing.encoder_input(cutout.crop(framing.frame(trained, cutout), trained.image_size))
    return reconstruction_models.encode_batch(network, framed.to(network.shape_encoder.fc.weight))[1][0]


def seeded(seed: int) -> torch.Generator:
    """On the device of the models."""
    return torch.Generator(model_files.device()).manual_seed(seed)


@contextlib.contextmanager
def timed(table: dict[str, float], name: str) -> Iterator[None]:
    """Note the wall time of a block in a table, and in the log."""
    started = time.monotonic()
    yield
    table[name] = time.monotonic() - started
    LOGGER.info("%s: %.1f s", name, table[name])

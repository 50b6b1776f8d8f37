"""One image or several of one object to its field, by the model with image features along the ray.

Each picture is framed and its camera predicted, or told. A predicted one is then corrected by its own picture
(`line_cameras`); turning those of several until the pictures agree made fields of three no better on validation shapes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, UInt8

from ddf.core import checks
from ddf.fields import model_files
from ddf.models import line_field, reconstruction_models
from ddf.reconstruction import framing, given_cameras, line_cameras, line_clouds, one_image


@dataclass(frozen=True)
class Reconstructed(one_image.Reconstructed):
    """As of one image. views: the object of every picture as it was framed, which the camera of each sees."""

    views: Sequence[UInt8[np.ndarray, "s s 4"]]


def reconstruct(
    trained: line_field.TrainedImageDDF,
    pictures: Sequence[UInt8[np.ndarray, "_ _ 4"]],
    points: int,
    seed: int = 0,
    seen_from: Sequence[given_cameras.Camera] | None = None,
) -> Reconstructed:
    """Field, cloud and cameras of the object; `view` is that of the first picture.

    Args:
      pictures: of `cutouts.read`, all of one object. points: that the cloud must have, 2 or more.
      seen_from: the camera of each; None to predict them.
    Raises:
      InputError: no picture, fewer than 2 points, or a camera does not look at the object.
    """
    if points < 2 or not pictures:
        raise checks.InputError(f"2 points or more and a picture are needed; got {points} and {len(pictures)}")
    model, size, statistics = trained
    seconds: dict[str, float] = {}
    with one_image.timed(seconds, "framing"):
        farthest = float(model.camera_head.highest[2])
        told = [None] * len(pictures) if seen_from is None else seen_from
        cutouts, told = zip(*(_framed(*each, farthest) for each in zip(pictures, told, strict=True)), strict=True)
        frames = [framing.frame(trained, cutout) for cutout in cutouts]
        crops = [cutout.crop(frame, size) for cutout, frame in zip(cutouts, frames, strict=True)]
        framed = torch.cat([framing.encoder_input(crop) for crop in crops]).to(model_files.device())
    with one_image.timed(seconds, "encoders"), torch.no_grad():
        stages, _, predicted = reconstruction_models.encode_batch(model, framed)
        scores = [None] * len(framed) if statistics is None else statistics.score(torch.cat(stages, dim=1)).tolist()
        given = predicted if seen_from is None else torch.from_numpy(np.stack(told)).to(predicted)
        each = model.views(framed, given)
    if seen_from is None:
        with one_image.timed(seconds, "camera"):
            how, alpha = model.decoder, framed[:, 3]
            alone = [line_field.Views(*(part[row, None] for part in each)) for row in range(len(alpha))]
            found = [line_cameras.corrected(how, *pair) for pair in zip(alone, alpha, strict=True)]
            each = each._replace(cameras=torch.stack(found)[:, None])
    field = line_field.ImageField.of(model.decoder, each.of_one_shape())
    with one_image.timed(seconds, "cloud"):
        cloud = line_clouds.draw(field, max(points, one_image.WHOLE), one_image.seeded(seed))
    lower, upper = one_image.box_of(cloud, field.lower, field.upper)
    field = line_field.ImageField(field.decoder, field.views, lower, upper)
    points_v1 = cloud.double().cpu().numpy() / line_field.FIELD_FROM_V1
    views = [cutout.crop(frame, one_image.VIEW) for cutout, frame in zip(cutouts, frames, strict=True)]
    return Reconstructed(field, points_v1, each.cameras[:, 0], views[0], scores, seconds, views)


def _framed(
    pixels: UInt8[np.ndarray, "_ _ 4"], camera: given_cameras.Camera | None, farthest: float
) -> tuple[framing.Cutout, Float[np.ndarray, "3"] | None]:
    """A picture as its camera sees the framed object, if it is known."""
    if not isinstance(camera, given_cameras.Pinhole):
        return framing.Cutout(pixels), camera
    pixels, found = camera.framed(pixels, farthest)
    return framing.Cutout(pixels, framed=True), found

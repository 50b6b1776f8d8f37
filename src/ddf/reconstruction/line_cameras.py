"""The camera of one image of a field with image features, corrected by the image: Π̂_∇ of [DDF22] §4.3 (derived here).

What projects on transparent pixels is empty by construction; of L_M, the loss of the rendered mask, the opaque pixels
are left. Their rays must meet something, and by a wrong camera the features lie at wrong places: the field doubts.
Cameras err in two ways. They take front for rear: the azimuth turns all around, and far away only where the field is
surer of its mask and of all its surfaces by more than `LEAST`. They err by some degrees: near the better end the mask
alone decides, beside the encoder's own error. Both numbers were chosen on validation shapes; elevation and radius,
which the encoder knows better, stay.
"""

import math
import time
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor
from torch.nn import functional

from ddf.data.batches import category_data
from ddf.fields import rendering
from ddf.geometry import cameras
from ddf.models import line_field, reconstruction_settings
from ddf.reconstruction import line_clouds, many_images

AROUND, NEAR, LEAST = 15, 30, 0.2  # degrees of a turn, and below which it is none; what one gains at least
FARTHEST, COARSE, FINE, ERROR = 24, 4, 2, 8.0  # degrees: of turns near the better end, and of the encoder's error
WEIGHT = 100.0  # of the mask beside that error
SIDE, LINES = 24, 600  # pixels of the mask; lines across the box
_LEAST_SEEN = 1e-3


@torch.no_grad()
def corrected(
    decoder: line_field.LineDecoder, views: line_field.Views, alpha: Float[Tensor, "s s"]
) -> Float[Tensor, "3"]:
    """The camera (azimuth, elevation, radius) of one view of one shape, whose azimuth the image turned."""
    camera, opaque = views.cameras[0, 0], category_data.averaged(alpha[None], SIDE)[0] > 0.5
    if not opaque.any():
        return camera
    how: Any = {"generator": torch.Generator(camera.device).manual_seed(0), "device": camera.device}
    starts = decoder.lower + (decoder.upper - decoder.lower) * torch.rand((LINES, 3), **how)
    along = functional.normalize(torch.randn((LINES, 3), **how), dim=-1)

    def field(turn: int) -> line_field.ImageField:
        return line_field.ImageField.of(decoder, views._replace(cameras=_turned(camera, turn)[None, None]))

    def mask(turn: int) -> float:
        return _seen(field(turn), _turned(camera, turn), opaque)

    def whole(turn: int) -> float:
        return mask(turn) + _sure(field(turn), starts, along)

    found = {turn: whole(turn) for turn in range(AROUND - 180, 181, AROUND) if abs(turn) != NEAR}
    near, far = (max((t for t in found if (abs(t) < NEAR) == close), key=found.__getitem__) for close in (True, False))
    start = far if found[far] > found[near] + LEAST else 0

    def own(turn: int) -> float:
        return WEIGHT * mask(turn) - ((turn - start) / ERROR) ** 2 / 2

    best = max(range(start - FARTHEST, start + FARTHEST + 1, COARSE), key=own)
    return _turned(camera, max((best - FINE, best, best + FINE), key=own))


def _turned(camera: Float[Tensor, "3"], degrees: int) -> Float[Tensor, "3"]:
    return torch.cat(((camera[:1] + math.radians(degrees)) % (2 * math.pi), camera[1:]))


def _seen(field: line_field.ImageField, camera: Float[Tensor, "3"], opaque: Bool[Tensor, "s s"]) -> float:
    """Mean log ξ of rays through opaque pixels."""
    directions = cameras.pixel_directions(len(opaque), camera)[opaque]
    scale = camera.new_full((1,), line_field.FIELD_FROM_V1)
    entry, world, _, _ = rendering.field_rays(camera[None], scale, directions)
    _, missed = field.parts(entry[0], world[0]).log_weights()
    return float((1 - missed.exp()).clamp_min(_LEAST_SEEN).log().mean())


def _sure(field: line_field.ImageField, starts: Float[Tensor, "n 3"], along: Float[Tensor, "n 3"]) -> float:
    """Logarithms of how sure the surfaces of lines are, by their own chances, and of how many there are on each."""
    logits = field.parts(starts, along).logits
    chance = torch.where(logits > line_field.EMPTY, logits.sigmoid(), 0.0)
    total = chance.sum().clamp_min(_LEAST_SEEN)
    return float((chance.square().sum() / total).clamp_min(_LEAST_SEEN).log() + (total / len(starts)).log())


def reconstruct(
    model: line_field.ImageDDFModel,
    images: category_data.ImageSet,
    config: reconstruction_settings.PointcloudsConfig,
    predicted: Float[Tensor, "n 3"],
) -> tuple[dict[str, Tensor], float]:
    """Corrected cameras of all images, and clouds by them (`L.corrected`, `S.corrected`), as of `line_clouds`; and
    seconds that a correction took.
    """
    place = model.decoder.lower

    def views(row: int, camera: Tensor) -> line_field.Views:
        return line_clouds.views_of(model, images, np.array([row]))._replace(cameras=camera[None, None].to(place))

    def correct(row: int) -> Tensor:
        return corrected(model.decoder, views(row, predicted[row]), images.batch(np.array([row]))[0, 3].to(place))

    def draw(row: int) -> Tensor:
        field = line_field.ImageField.of(model.decoder, views(row, found[row]))
        return line_clouds.draw(field, config.large, many_images.generator_of(config, row))

    started, rows = time.monotonic(), range(len(predicted))
    found = list(many_images.in_threads(correct, rows))
    seconds = (time.monotonic() - started) / len(rows)
    large = torch.stack(list(many_images.in_threads(draw, rows)))
    tensors = {"camera_corrected": torch.stack(found), "L.corrected": large, "S.corrected": large[:, : config.small]}
    return many_images.on_cpu(tensors), seconds

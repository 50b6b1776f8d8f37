"""One optimisation step of the model with image features along the ray (`models.line_field`)."""

import math

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.core import arrays
from ddf.data.batches import category_data
from ddf.geometry import cameras
from ddf.models import line_field, reconstruction_settings
from ddf.training import reconstruction_steps

USUAL_ERROR = (math.radians(6.0), math.radians(2.0), 0.02)  # of a camera encoder: azimuth, elevation, share of radius
DEPTH_WEIGHT, DEPTH_HUBER = 20.0, 0.02  # of the place in the part that is hit; field units


def ddf_image_step(
    model: line_field.ImageDDFModel,
    images: category_data.ImageSet,
    shapes: category_data.ShapeSet,
    samples: category_data.SampleSource,
    train: reconstruction_settings.TrainConfig,
    config: line_field.LineFieldConfig,
    step: int,
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """-log w of the part that holds the true hit, -log (1 - ξ) where there is none, Huber of the depth, γ_RΠ L_Π.

    The camera of the features errs as predicted ones do, and the shape turns with it: what the image shows stays where
    the camera sees it, so that the field agrees with the image whatever the camera.
    """
    batch = reconstruction_steps.Batch.draw(images, train, step)
    place = batch.images.device
    points = samples.draw(batch.drawn, config.counts(), batch.random, batch.part).to(place)
    scale = arrays.send(shapes.field_scales(batch.shapes), place)[:, None]
    shift = arrays.send(shapes.field_shifts(batch.shapes), place)[:, None]
    unit = line_field.FIELD_FROM_V1 / scale
    positions, depth = unit[..., None] * (points.positions - shift), unit * points.depth
    seen_from = batch.cameras
    directions = points.directions
    if config.camera_noise:
        noise = torch.from_numpy(batch.random.standard_normal((len(batch.drawn), 3))[batch.part]).to(seen_from)
        size = seen_from.new_tensor(USUAL_ERROR) * config.camera_noise
        erring = seen_from + noise * size * torch.cat((torch.ones_like(seen_from[:, :2]), seen_from[:, 2:]), dim=-1)
        positions, directions = turned(positions, directions, seen_from, erring)
        seen_from = erring
    parts = model.decoder(model.views(batch.images, seen_from), positions, directions)
    weights, missed = parts.log_weights()
    hit = points.visible > 0.5
    struck = ((depth - parts.entry) / parts.step).floor().long().clamp(0, model.decoder.places - 1)[..., None]
    chance = -torch.where(hit, weights.gather(-1, struck)[..., 0], missed).mean()
    off = functional.huber_loss(parts.hits.gather(-1, struck)[..., 0], depth, reduction="none", delta=DEPTH_HUBER)
    placed = DEPTH_WEIGHT * (off * hit).sum() / hit.sum().clamp_min(1)
    from_cameras, _ = reconstruction_steps.camera_loss(model, batch, train)
    total = chance + placed + reconstruction_settings.CAMERA_WEIGHT * from_cameras
    return total, {"chance": chance.detach(), "depth": placed.detach(), "camera": from_cameras.detach()}


def turned(
    positions: Float[Tensor, "b n 3"],
    directions: Float[Tensor, "b n 3"],
    camera: Float[Tensor, "b 3"],
    other: Float[Tensor, "b 3"],
) -> tuple[Float[Tensor, "b n 3"], Float[Tensor, "b n 3"]]:
    """Oriented points, field frame, moved so that `other` sees them as `camera` did."""
    before, after = (cameras.extrinsics(*each.unbind(-1)) for each in (camera, other))
    unit = line_field.BENCHMARK_FROM_FIELD
    return cameras.moved(unit * positions, before, after) / unit, directions @ before[0].transpose(-1, -2) @ after[0]

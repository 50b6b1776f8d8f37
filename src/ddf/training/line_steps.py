"""Training of the model with image features along the ray (`models.line_field`): its steps, and where it starts."""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.core import arrays, checks, shipped_models
from ddf.core.schema import setting
from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.geometry import cameras
from ddf.models import line_field, out_of_distribution, reconstruction_models, reconstruction_settings
from ddf.training import reconstruction_steps

USUAL_ERROR = (math.radians(6.0), math.radians(2.0), 0.02)  # of a camera encoder: azimuth, elevation, share of radius
_SIZES = ("encoder", "encoder_width", "latent_features", "decoder", "azimuth", "told")  # of `train`
DEPTH_WEIGHT, DEPTH_HUBER = 20.0, 0.02  # of the place in the part that is hit; field units


@dataclass(frozen=True)
class ImageTrainConfig(line_field.LineFieldConfig):
    """Section `ddf_image`: the model, and what its training starts from."""

    start: str = setting("", "trained model to start from: shipped (that of the category's name), a name or a folder")

    def started(
        self, train: reconstruction_settings.TrainConfig, category: str
    ) -> tuple[reconstruction_settings.TrainConfig, line_field.LineFieldConfig, Path | None]:
        """Both sections with the sizes of the model to start from, and its file; None where training starts afresh.
        InputError where that is of another kind, or takes images of another size.
        """
        own = {each.name: getattr(self, each.name) for each in dataclasses.fields(line_field.LineFieldConfig)}
        if not self.start:
            return train, line_field.LineFieldConfig(**own), None
        given = category if self.start == "shipped" else Path(self.start).expanduser()
        place = shipped_models.require(given, "reconstruction")
        folder, theirs, section = reconstruction_models.recorded(place, line_field.KIND)
        if train.image_size != theirs.image_size:
            raise checks.InputError(f"train.image_size must be {theirs.image_size}, for ddf_image.start is {folder}")
        train = dataclasses.replace(train, **{name: getattr(theirs, name) for name in _SIZES})
        own |= {"places": section["places"], "width": section["width"]}
        return train, line_field.LineFieldConfig(**own), folder / model_files.MODEL


def start_from(model: line_field.ImageDDFModel, file: Path) -> None:
    """Take the weights of a trained model; the model's box and range of cameras grow to hold the other's."""
    decoder, head = model.decoder, model.camera_head
    upper, lowest, highest = (each.clone() for each in (decoder.upper, head.lowest, head.highest))
    model_files.load_model(model, file.parent, out_of_distribution.PREFIX)
    decoder.upper.copy_(torch.maximum(decoder.upper, upper))
    decoder.lower.copy_(-decoder.upper)
    head.lowest.copy_(torch.minimum(head.lowest, lowest))
    head.highest.copy_(torch.maximum(head.highest, highest))


def ddf_image_step(
    model: line_field.ImageDDFModel,
    images: category_data.ImageSet,
    shapes: category_data.ShapeSet,
    samples: category_data.SampleSet,
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
    points = samples.draw(batch.shapes, config.counts(), batch.random).to(place)
    scale = arrays.send(shapes.field_scales(batch.shapes), place)[:, None]
    shift = arrays.send(shapes.field_shifts(batch.shapes), place)[:, None]
    unit = line_field.FIELD_FROM_V1 / scale
    positions, depth = unit[..., None] * (points.positions - shift), unit * points.depth
    seen_from = batch.cameras
    directions = points.directions
    if config.camera_noise:
        noise = torch.from_numpy(batch.random.standard_normal((len(batch.shapes), 3))).to(seen_from)
        size = seen_from.new_tensor(USUAL_ERROR) * config.camera_noise
        erring = seen_from + noise * size * torch.cat((torch.ones_like(seen_from[:, :2]), seen_from[:, 2:]), dim=-1)
        positions, directions = turned(positions, directions, seen_from, erring)
        seen_from = erring
    hit = points.visible > 0.5
    until = torch.where(hit, depth, torch.inf)  # what a ray would meet later is not in the loss
    parts = model.decoder(model.views(batch.images, seen_from), positions, directions, until)
    weights, missed = parts.log_weights()
    struck = line_field.part_of(depth, parts.entry, parts.step).long().clamp(0, model.decoder.places - 1)[..., None]
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

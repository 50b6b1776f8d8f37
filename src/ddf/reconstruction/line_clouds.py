"""Clouds of fields with image features along the ray: all surfaces of random lines, the surest, evenly spread.

A random line meets a surface the more often the larger its area, outer and inner ones alike (Crofton), and the field
says all of a line's surfaces at once: no point is projected twice. A farthest-point order of the hits, weighted by how
sure they are, makes the cloud even.
"""

import time

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor
from torch.nn import functional

from ddf.data.batches import category_data
from ddf.fields import cloud_projection, rendering
from ddf.geometry import cameras
from ddf.models import line_field, reconstruction_settings
from ddf.reconstruction import many_images

LINES, BATCH = 16_384, 1024  # across the box: at most, and at a time
LEAST = 0.15  # chance of a surface from which on a part of a line is a hit; of the largest chance of the first lines
MOST = 12_000  # hits that are put in order
SPREAD = 2.0  # power of the chance in the order's weights


@torch.no_grad()
def draw(field: line_field.ImageField, count: int, generator: torch.Generator) -> Float[Tensor, "count 3"]:
    """A cloud of a field, field frame, in an order of which every first part is a cloud too.

    Lines are drawn until they have `MOST` hits, `LINES` at most.

    Returns:
      Repeated points where there are fewer hits; the middle of the box where the image shows nothing.
    """
    lower, upper = field.decoder.lower, field.decoder.upper
    hits, sure, total, least = [], [], 0, 0.0
    for _ in range(LINES // BATCH):
        starts = lower + (upper - lower) * torch.rand((BATCH, 3), generator=generator, device=generator.device)
        along = functional.normalize(torch.randn((BATCH, 3), generator=generator, device=generator.device), dim=-1)
        parts = field.parts(starts, along)
        chance = parts.logits[0].sigmoid()
        least = least or LEAST * float(chance.max())
        line, part = ((chance > least) & (parts.logits[0] > line_field.EMPTY)).nonzero().unbind(-1)
        hits.append(starts[line] + parts.hits[0][line, part, None] * along[line])
        sure.append(chance[line, part])
        total += len(line)
        if total >= MOST:
            break
    if total == 0:
        return ((lower + upper) / 2).expand(count, 3).clone()
    order = cloud_projection.farthest_point_order(torch.cat(hits)[:MOST], count, torch.cat(sure)[:MOST].pow(SPREAD))
    return torch.cat(hits)[order]


def reconstruct(
    model: line_field.ImageDDFModel, images: category_data.ImageSet, config: reconstruction_settings.PointcloudsConfig
) -> tuple[dict[str, Tensor], dict]:
    """Clouds L and S of all images by the true camera (`L.true`) and by the predicted one (`L.pred`), predicted
    cameras and the overlap of silhouettes; and the facts, as `many_images.reconstruct_ddf`.

    The field frame is twice v1 whatever the shape: no scale is told at the true camera, none estimated.
    """
    (_, _, predicted), encoding = many_images.timed_encode(model, images)

    def of(row: int) -> dict[str, Tensor]:
        rows, found = np.array([row]), {}
        true = views_of(model, images, rows)
        for name, views in (("true", true), ("pred", true._replace(cameras=predicted[[row], None]))):
            field = line_field.ImageField.of(model.decoder, views)
            cloud = draw(field, config.large, many_images.generator_of(config, row))
            found |= {f"L.{name}": cloud, f"S.{name}": cloud[: config.small]}
        given = images.batch(rows)[0, 3].to(predicted) > 0.5
        return found | {"silhouette_iou": overlap(field, given, predicted[row])}

    started = time.monotonic()
    made = list(many_images.in_threads(of, range(len(images.shapes))))
    cloud = (time.monotonic() - started) / 2 / len(images.shapes)
    tensors = {name: torch.stack([each[name] for each in made]) for name in made[0]}
    scale = torch.full((len(made),), 1 / line_field.FIELD_FROM_V1)
    tensors |= {"camera_pred": predicted, many_images.SCALE: scale, "scale_true": scale}
    tensors["centre_true"] = torch.zeros((len(made), 3))
    return many_images.on_cpu(tensors), {"seconds": {"encoders": encoding, "cloud": cloud}}


@torch.no_grad()
def views_of(
    model: line_field.ImageDDFModel, images: category_data.ImageSet, rows: Int[np.ndarray, "k"]
) -> line_field.Views:
    """Some images, by their true cameras, as views of one shape."""
    place = model.decoder.lower
    return model.views(images.batch(rows).to(place), images.cameras_of(rows).to(place)).of_one_shape()


@torch.no_grad()
def overlap(field: line_field.ImageField, given: Bool[Tensor, "s s"], camera: Float[Tensor, "3"]) -> Float[Tensor, ""]:
    """Intersection over union of the field's silhouette from a camera and a mask."""
    directions = cameras.pixel_directions(len(given), camera).reshape(-1, 3)
    scale = camera.new_full((1,), line_field.FIELD_FROM_V1)
    entry, world, _, meets = rendering.field_rays(camera[None], scale, directions)
    _, missed = field.parts(entry[0], world[0]).log_weights()
    own = ((1 - missed[0].exp() > 0.5) & meets[0]).view_as(given)
    return (own & given).sum() / (own | given).sum().clamp_min(1)

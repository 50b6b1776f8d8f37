"""Clouds of shapes that are seen in three images, at the true cameras, frame of v1.

The model with image features takes all three as they are; the others, which know no cameras, get the mean of three
latents. Of a shape the first three of its images count; shapes with fewer have no such cloud.
"""

from collections.abc import Callable

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.data.batches import category_data
from ddf.fields import cloud_projection
from ddf.models import line_field, reconstruction_models, reconstruction_settings
from ddf.reconstruction import line_clouds, many_images

CLOUDS, VIEWS = "three_views", 3  # name in the files of clouds

Rows = Int[np.ndarray, "3"]


def first_three(images: category_data.ImageSet) -> dict[str, Rows]:
    """Rows of the first three images of each shape that has them, by id."""
    shapes = np.unique(images.shapes).tolist()
    rows = {str(images.ids[shape]): np.flatnonzero(images.shapes == shape)[:VIEWS] for shape in shapes}
    return {name: own for name, own in rows.items() if len(own) == VIEWS}


def _of_all(
    images: category_data.ImageSet, cloud: Callable[[Rows], Float[Tensor, "n 3"]]
) -> tuple[dict[str, Tensor], dict[str, list[str]]]:
    trios = first_three(images)
    made = list(many_images.in_threads(cloud, list(trios.values())))
    return many_images.on_cpu({CLOUDS: torch.stack(made)} if made else {}), {CLOUDS: list(trios)}


def of_latents(
    model: reconstruction_models.DDFModel | reconstruction_models.PCSirenModel,
    images: category_data.ImageSet,
    shapes: category_data.ShapeSet,
    config: reconstruction_settings.PointcloudsConfig,
) -> tuple[dict[str, Tensor], dict[str, list[str]]]:
    """Clouds L of a model whose shape is a latent, and whose they are; placed as the true shapes are."""

    def cloud(rows: Rows) -> Float[Tensor, "n 3"]:
        generator = many_images.generator_of(config, int(rows[0]))
        _, latents, _ = reconstruction_models.encode_batch(model, images.batch(rows).to(generator.device))
        latent = latents.mean(dim=0, keepdim=True)
        if isinstance(model, reconstruction_models.DDFModel):
            own = [m[0].detach() for m in model.modulations(latent)]
            found = cloud_projection.draw(model.field, own, config.large, config.cloud, generator)
        else:
            found = many_images.pcsiren_cloud(model, latent, config, generator)
        back = shapes.similarities[int(images.shapes[rows[0]])].inverse()
        return back.scale * found + torch.from_numpy(back.translation).to(found)

    return _of_all(images, cloud)


def of_features(
    model: line_field.ImageDDFModel, images: category_data.ImageSet, config: reconstruction_settings.PointcloudsConfig
) -> tuple[dict[str, Tensor], dict[str, list[str]]]:
    """Clouds L of the model with image features, and whose they are."""

    def cloud(rows: Rows) -> Float[Tensor, "n 3"]:
        field = line_field.ImageField.of(model.decoder, line_clouds.views_of(model, images, rows))
        found = line_clouds.draw(field, config.large, many_images.generator_of(config, int(rows[0])))
        return found / line_field.FIELD_FROM_V1

    return _of_all(images, cloud)

"""What the encoders of a model make of images."""

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import reconstruction_models

# Images at a time; the networks are in evaluation mode, so the sizes matter to the result by rounding alone.
ENCODER_BATCH = 64
Rows = Int[np.ndarray, "_"]  # of images


def row_batches(images: category_data.ImageSet, size: int = ENCODER_BATCH) -> list[Rows]:
    """Rows of at most so many images at a time."""
    count = len(images.shapes)
    return np.array_split(np.arange(count), -(-count // size))


Stages = tuple[Float[Tensor, "n _"], ...]


@torch.no_grad()
def encode_batch(
    model: reconstruction_models.ReconstructionModel, batch: Float[Tensor, "n 4 s s"]
) -> tuple[Stages, Float[Tensor, "n z"], Float[Tensor, "n 3"]]:
    """Features of the shape encoder's stages, shape latents and predicted cameras of some images."""
    stages = model.shape_encoder.stages(batch)
    return stages, model.shape_encoder.fc(stages[-1]), model.camera_head(model.camera_encoder(batch))


def encode(
    model: reconstruction_models.ReconstructionModel, images: category_data.ImageSet
) -> tuple[Float[Tensor, "n features"], Float[Tensor, "n z"], Float[Tensor, "n 3"]]:
    """Features of the last stage, latents and cameras of all images."""
    batches = (images.batch(rows).to(model_files.device()) for rows in row_batches(images))
    stages, latents, found = zip(*(encode_batch(model, batch) for batch in batches), strict=True)
    return torch.cat([each[-1] for each in stages]), torch.cat(latents), torch.cat(found)


def image_features(
    model: reconstruction_models.ReconstructionModel, images: category_data.ImageSet
) -> Float[Tensor, "n features"]:
    """Pooled features of the shape encoder, by which the retrieval row finds the nearest training image."""
    return image_stages(model, images)[-1]


@torch.no_grad()
def image_stages(model: reconstruction_models.ReconstructionModel, images: category_data.ImageSet) -> Stages:
    """The same of its stages, by which `familiarity` tells how usual an image is."""
    batches = (images.batch(rows).to(model_files.device()) for rows in row_batches(images))
    found = (model.shape_encoder.stages(batch) for batch in batches)
    return tuple(torch.cat(stage).cpu() for stage in zip(*found, strict=True))

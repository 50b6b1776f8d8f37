"""The image network on whose features images are scored: it learns to tell shapes and views apart. Chosen here.

ResNet-20 on images of the shapes that the VAE has; the critics' images, which the scores are about, show others. Its
features are those before the last layer. Inception's would say more of photographs; these are of renders.
"""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from ddf.core import distributed
from ddf.data.batches import category_data
from ddf.fields import model_files
from ddf.models import generative_settings, records, translators
from ddf.training import gan_steps

KIND = "image_features"  # of the file's record
_CHUNK = 256  # images at a time; memory only


class FeatureNetwork(nn.Module):
    """Scores of the shapes that it learned, and (cos, sin) of the azimuth."""

    def __init__(self, settings: generative_settings.FeaturesConfig, shapes: int) -> None:
        super().__init__()
        self.settings, self.shapes = settings, shapes
        self.body = translators.TextureEncoder(shapes + 2, settings.width)

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Of the optimiser."""
        return [{"params": list(self.parameters()), "weight_decay": 1e-4}]

    @torch.no_grad()
    def features(self, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n features"]:
        """Of colours in [-1, 1]; on the CPU."""
        place = next(self.parameters()).device
        return torch.cat([self.body.features(part.to(place)).cpu() for part in images.split(_CHUNK)])


def step_loss(
    model: FeatureNetwork, images: category_data.ImageSet, step: int
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """Cross-entropy of the shape + squared error of (cos, sin) of the azimuth, over random images."""
    random = np.random.default_rng((model.settings.loop.seed, step))
    batch = model.settings.batch_size
    rows = random.integers(0, len(images.shapes), batch)[distributed.part(batch)]
    place = next(model.parameters()).device
    found = model.body(gan_steps.on_white(images.batch(rows)).to(place))
    shape = functional.cross_entropy(found[:, : model.shapes], torch.from_numpy(images.shapes[rows]).to(place))
    azimuth = images.cameras[rows, 0].to(place)
    view = functional.mse_loss(found[:, model.shapes :], torch.stack((azimuth.cos(), azimuth.sin()), dim=-1))
    return shape + view, {"shape": shape.detach(), "view": view.detach()}


def description(section: generative_settings.FeaturesConfig, category: str, shapes: int) -> dict[str, Any]:
    """What the record of its file holds besides what every artefact carries."""
    return {"kind": KIND, "category": category, "features": dataclasses.asdict(section), "shapes": shapes}


def load(folder: Path) -> FeatureNetwork:
    """The network of a folder that stage `train_features` wrote, in evaluation mode.

    Raises:
      FileNotFoundError: there is none. InputError: the file is damaged, or holds something else.
    """
    record = records.read(folder, KIND, "train_features")
    section = records.section(record, "features", generative_settings.FeaturesConfig, folder)
    model = FeatureNetwork(section, record["shapes"])
    model_files.load_model(model, folder)
    return model

"""Single-image 3D reconstruction: the two models, camera regression and correction. [DDF22] §4.3, app. E.

An RGBA image goes to a shape latent z_s and to a camera (azimuth, elevation, radius); a conditional PDDF or PC-SIREN
turns z_s into a shape. Cameras are (..., 3): azimuth and elevation in radians, radius in benchmark units.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional

from ddf.core import checks
from ddf.data.batches import category_data
from ddf.fields import pddf, rendering, siren
from ddf.fields.gpu import compiled_passes
from ddf.geometry import cameras
from ddf.models import camera_encoder, encoders, reconstruction_settings

LEAST_PAIR = 0.05  # a (sin θ, cos θ) shorter than this says nothing; the slope of its angle is 1 / length
MOST_MASKS = 1000  # of the training set, that say what is usual
LOG_OF_ZERO = -100.0  # where `torch.nn.functional.binary_cross_entropy` bounds a logarithm


class CameraHead(nn.Module):
    """What the camera encoder gives to physical units, by the statistics of the training cameras.

    azimuth: `angle` is the paper's way, three z-scores, in which 0 and 2π are the farthest apart. `sincos` gives the
    azimuth as (sin θ, cos θ), which has no end, before the z-scores of elevation and radius; the two have unit variance
    together, as a z-score has, where azimuths are spread evenly (derived here).
    """

    mean: Tensor
    deviation: Tensor
    lowest: Tensor
    highest: Tensor

    def __init__(self, azimuth: reconstruction_settings.Azimuth = "angle") -> None:
        super().__init__()
        self.azimuth = azimuth
        self.register_buffer("mean", torch.zeros(3))
        self.register_buffer("deviation", torch.ones(3))
        self.register_buffer("lowest", torch.full((3,), -torch.inf))
        self.register_buffer("highest", torch.full((3,), torch.inf))

    def fit(self, training_cameras: Float[Tensor, "n 3"]) -> None:
        """Take mean, deviation and range from the training set.

        Raises:
          InputError: fewer than two cameras, or one of the three numbers never varies.
        """
        if len(training_cameras) < 2:
            raise checks.InputError(f"training cameras must be at least 2; got {len(training_cameras)}")
        deviation = training_cameras.std(dim=0)
        if not bool((deviation > 0).all()):
            raise checks.InputError(f"azimuth, elevation and radius must vary over the training set; got {deviation}")
        self.mean.copy_(training_cameras.mean(dim=0))
        self.deviation.copy_(deviation)
        self.lowest.copy_(training_cameras.amin(dim=0))
        self.highest.copy_(training_cameras.amax(dim=0))

    @property
    def num_scores(self) -> int:
        """Numbers that the encoder gives."""
        return 3 if self.azimuth == "angle" else 4

    def loss(self, scores: Float[Tensor, "b scores"], truth: Float[Tensor, "b 3"]) -> Float[Tensor, ""]:
        """L_Π = ‖Π_g - Π̂‖² of the scores, mean over images; before clamping, so that its gradient never dies."""
        wanted = (truth - self.mean) / self.deviation
        if self.azimuth == "sincos":
            wanted = torch.cat((torch.sin(truth[:, :1]), torch.cos(truth[:, :1]), wanted[:, 1:]), dim=-1)
        return (scores - wanted).square().sum(-1).mean()

    def forward(self, scores: Float[Tensor, "b scores"]) -> Float[Tensor, "b 3"]:
        """Cameras, clamped to the range of the training set; an azimuth from (sin θ, cos θ) is in [0, 2π) instead.

        A pair shorter than `LEAST_PAIR` gives azimuth 0 and no gradient: L_Π alone draws it out.
        """
        last = scores if self.azimuth == "angle" else scores[:, 1:]
        camera = last * self.deviation + self.mean
        bounded = torch.minimum(torch.maximum(camera, self.lowest), self.highest)
        return bounded if self.azimuth == "angle" else torch.cat((_angle(scores[:, :2]), bounded[:, 1:]), dim=-1)


def _angle(pair: Float[Tensor, "b 2"]) -> Float[Tensor, "b 1"]:
    """θ in [0, 2π) of (sin θ, cos θ) of any length."""
    sine, cosine = pair[:, :1], pair[:, 1:]
    undecided = sine.square() + cosine.square() < LEAST_PAIR**2
    angle = torch.atan2(torch.where(undecided, 0.0, sine), torch.where(undecided, 1.0, cosine))
    return torch.where(angle < 0, angle + 2 * math.pi, angle)


class ReconstructionModel(nn.Module):
    """Two encoders and a decoder. Parameters at the paper's sizes: 25,647,367 (DDF) and 25,645,574 (PC-SIREN)."""

    def __init__(
        self,
        decoder: nn.Module,
        latent_features: int,
        encoder_width: int,
        azimuth: reconstruction_settings.Azimuth = "angle",
        encoder: str = "resnet",
        told: bool = False,
    ) -> None:
        super().__init__()
        make = encoders.ENCODERS[encoder]
        self.camera_head = CameraHead(azimuth)
        self.shape_encoder = make(latent_features, encoder_width)
        scores = self.camera_head.num_scores
        self.camera_encoder: nn.Module = (
            camera_encoder.ToldEncoder(make, scores, encoder_width) if told else make(scores, encoder_width)
        )
        self.decoder = decoder

    def fit_cameras(self, images: category_data.ImageSet) -> None:
        """Take from the training images what cameras and masks are usual; as `CameraHead.fit`."""
        self.camera_head.fit(images.cameras)
        if isinstance(self.camera_encoder, camera_encoder.ToldEncoder):
            rows = np.linspace(0, len(images.shapes) - 1, min(MOST_MASKS, len(images.shapes))).round().astype(int)
            self.camera_encoder.fit(images.batch(rows)[:, 3], images.cameras[:, 2])

    def parameter_groups(self, encoder_share: float = 1.0) -> list[dict]:
        """AdamW groups: decay on the two predictors, none on the decoder. Source: [DDF22] app. E.

        Args:
          encoder_share: the predictors' learning rate as a share of the decoder's; 1 is the paper's way.
        """
        of_rate = {"share": encoder_share}
        return [
            {
                "params": list(self.shape_encoder.parameters()),
                "weight_decay": reconstruction_settings.WEIGHT_DECAY_SHAPE,
                **of_rate,
            },
            {
                "params": list(self.camera_encoder.parameters()),
                "weight_decay": reconstruction_settings.WEIGHT_DECAY_CAMERA,
                **of_rate,
            },
            {"params": list(self.decoder.parameters()), "weight_decay": 0.0},
        ]


class DDFModel(ReconstructionModel):
    """Single-image reconstruction with the conditional probabilistic DDF."""

    decoder: pddf.ConditionalPDDF

    def __init__(self, config: pddf.PDDFConfig, latent_features: int, *encoders: Any) -> None:
        super().__init__(pddf.ConditionalPDDF(config, latent_features), latent_features, *encoders)

    @property
    def field(self) -> pddf.PDDF:
        """The field that the modulations of `modulations` condition."""
        return self.decoder.field

    def modulations(self, latent: Float[Tensor, "*b z"]) -> list[Float[Tensor, "*b 1 _"]]:
        """One modulation per sine layer and shape."""
        return self.decoder.modulator(latent)


class PCSirenModel(ReconstructionModel):
    """Single-image reconstruction with the PC-SIREN baseline."""

    decoder: pddf.PointDecoder

    def __init__(self, layout: siren.SineLayout, latent_features: int, *encoders: Any) -> None:
        super().__init__(pddf.PointDecoder(layout, latent_features), latent_features, *encoders)


def mask_loss(
    field: pddf.PDDF,
    modulations: Sequence[Float[Tensor, "b 1 _"]],
    camera: Float[Tensor, "b 3"],
    field_scale: Float[Tensor, "b"],
    alpha: Float[Tensor, "b size size"],
    num_pixels: int | None = None,
    chances: Float[Tensor, "b pixels"] | None = None,
    field_shift: Float[Tensor, "b 3"] | None = None,
) -> Float[Tensor, "b"]:
    """L_M per image: BCE of the alpha channel and the rendered visibility, mean over all pixels. Source: [DDF22] §4.3.

    Only pixels whose ray meets the cube are evaluated; with `num_pixels`, a random subset of those, scaled by the share
    of the image that they stand for: the ones with the largest `chances`, in [0, 1). The others render 0 whatever the
    field, and cost -log 0, taken as `LOG_OF_ZERO`, times their alpha: no query, no gradient.

    Args:
      field_shift: where the origin of v1 lies in the field frame, see `rendering.field_rays`.
    """
    size = alpha.shape[-1]
    directions = cameras.pixel_directions(size, alpha).reshape(-1, 3)
    with torch.no_grad():
        meets = rendering.field_rays(camera, field_scale, directions, field_shift)[3]
        chosen = _choose(meets, num_pixels, chances)
    entry, world, _, chosen_meets = rendering.field_rays(camera, field_scale, directions[chosen], field_shift)
    raw = compiled_passes.raw(field, entry, world, modulations)
    wanted = alpha.flatten(-2)
    target = wanted.gather(1, chosen)
    bce = functional.binary_cross_entropy_with_logits(raw[..., pddf.VISIBILITY_ROW], target, reduction="none")
    weight = chosen_meets.to(bce.dtype)
    met = (bce * weight).sum(-1) / weight.sum(-1).clamp_min(1) * meets.to(bce.dtype).mean(-1)
    return met - LOG_OF_ZERO * wanted.masked_fill(meets, 0.0).mean(-1)


def _choose(meets: Bool[Tensor, "b n"], num_pixels: int | None, chances: Float[Tensor, "b n"] | None) -> Tensor:
    """Indices of pixels that meet the box, random where there are more than `num_pixels`; padded with misses.

    A CPU leaves out what would pad every image; a GPU would be waited for, which takes longer than these queries.
    """
    most = int(meets.sum(-1).max()) if meets.device.type == "cpu" else meets.shape[-1]
    count = max(1, most if num_pixels is None else min(num_pixels, most))
    order = meets.to(torch.float32)
    if num_pixels is not None:
        if chances is None:
            raise ValueError("num_pixels needs chances, by which they are chosen")
        order = order * (1 + chances)
    return order.topk(count, dim=-1).indices


def ddf_model(train: reconstruction_settings.TrainConfig, field: reconstruction_settings.FieldConfig) -> DDFModel:
    """The DDF model of a config, freshly initialised."""
    return DDFModel(field.of(train.decoder), train.latent_features, *train.encoders)


def pcsiren_model(train: reconstruction_settings.TrainConfig) -> PCSirenModel:
    """The PC-SIREN model of a config, freshly initialised."""
    return PCSirenModel(train.decoder, train.latent_features, *train.encoders)

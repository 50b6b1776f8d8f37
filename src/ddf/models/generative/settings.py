"""Settings of generative modelling: the sections `vae`, `gan` and `scores` of an experiment file.

What [DDF22] §4.4 and app. genmodel leave open is chosen here and said in `configs/paper_generative.yaml`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from ddf.core import checks
from ddf.data.samples import sample_types
from ddf.fields import losses, pddf
from ddf.models.generative import translators
from ddf.training import training_loop


def require(section: str, settings: Any, least: Mapping[str, int | float]) -> None:
    """Raise unless each named setting is at least as large as it must be.

    Raises:
      InputError: naming section and key.
    """
    for name, bound in least.items():
        if not bound <= getattr(settings, name) < float("inf"):
            raise checks.InputError(f"{section}.{name} must be >= {bound:g}; got {getattr(settings, name)}")


@dataclass(frozen=True)
class VAEConfig:
    """Section `vae`: the shape VAE.

    field, latent_features: the decoder, a conditional PDDF, and dim(z_s). encoder_width: of PointNet, 64 is the
    paper's. points: with normals, that the encoder sees of a shape. held_out: shapes with samples that it does not
    learn. counts: oriented points per shape in a batch, as section `ddf` has them. divergence: whether L_KL is the sum
    over the dimensions of z_s or their mean; beta: its weight β. encoder_learning_rate: of the encoder, null for that
    of the decoder.
    """

    field: pddf.PDDFConfig
    latent_features: int
    encoder_width: int
    points: int
    held_out: int
    batch_size: int
    steps: int
    counts: dict[str, int]
    weights: losses.LossWeights
    beta: float
    divergence: Literal["sum", "mean"]
    loop: training_loop.LoopConfig
    encoder_learning_rate: float | None = None

    def __post_init__(self) -> None:
        least = {"latent_features": 1, "encoder_width": 8, "points": 2, "held_out": 1, "batch_size": 2, "steps": 1}
        require("vae", self, {**least, "beta": 0})
        sample_types.check_counts("vae.counts", self.counts)
        if self.encoder_learning_rate is not None and not self.encoder_learning_rate > 0:
            raise checks.InputError(f"vae.encoder_learning_rate must be > 0, or null; got {self.encoder_learning_rate}")


@dataclass(frozen=True)
class NormalsConfig:
    """Normals of random shapes, rendered ahead.

    images: how many. elevation_deg: range of the cameras' elevations, which are spread evenly over that part of the
    sphere, azimuths over the whole circle. radius: of all cameras, benchmark units. shard_size: images in one file.
    """

    images: int
    elevation_deg: tuple[float, float]
    radius: float
    shard_size: int
    seed: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "elevation_deg", tuple(self.elevation_deg))
        require("gan.normals", self, {"images": 1, "radius": 0.1, "shard_size": 1, "seed": 0})
        low, high = self.elevation_deg
        if not 0 <= low <= high <= 90:
            raise checks.InputError(
                f"gan.normals.elevation_deg must be two numbers in [0, 90], in order; got {[low, high]}"
            )


@dataclass(frozen=True)
class GANConfig:
    """Section `gan`: images from normals, and the 2D GAN that is compared with it. All are 64 x 64 pixels.

    normals: what f_T translates. views: of each shape that the critic is shown; null for all. texture_features:
    dim(z_T). translator_width, texture_width, critic_width, generator_width: 64, 16, 1024 and 1024 are the paper's.
    texture_at: pixels that z_T is given at; upsampling: how f_T and g_T double an image (both: `translators`).
    critic_steps: updates of the critic in a step, before the one of the generator. shape_consistency,
    texture_consistency: γ_CS, γ_CT. gradient_penalty: of E‖∇D‖² on real images. betas: of Adam. steps_2d: of the 2D
    GAN.
    """

    normals: NormalsConfig
    views: int | None
    texture_features: int
    translator_width: int
    texture_width: int
    critic_width: int
    texture_at: translators.TextureAt
    upsampling: translators.Upsampling
    generator_width: int
    noise_features: int
    batch_size: int
    critic_steps: int
    shape_consistency: float
    texture_consistency: float
    gradient_penalty: float
    betas: tuple[float, float]
    steps: int
    steps_2d: int
    loop: training_loop.LoopConfig

    def __post_init__(self) -> None:
        object.__setattr__(self, "betas", tuple(self.betas))
        widths = {"translator_width": 2, "texture_width": 2, "critic_width": 16, "generator_width": 16}
        least = {"texture_features": 1, "noise_features": 1, "batch_size": 2, "critic_steps": 1, "steps": 1}
        weights = {"shape_consistency": 0, "texture_consistency": 0, "gradient_penalty": 0}
        require("gan", self, {**widths, **least, **weights, "steps_2d": 1})
        if self.views is not None and self.views < 1:
            raise checks.InputError(f"gan.views must be >= 1, or null for all; got {self.views}")
        if not all(0 <= beta < 1 for beta in self.betas):
            raise checks.InputError(f"gan.betas must be in [0, 1); got {list(self.betas)}")


@dataclass(frozen=True)
class FeaturesConfig:
    """The image network whose features the scores of images are taken on.

    width: of ResNet-20, which has four times as many features. views: of each shape that it learns; null for all.
    """

    width: int
    views: int | None
    batch_size: int
    steps: int
    loop: training_loop.LoopConfig

    def __post_init__(self) -> None:
        require("scores.features", self, {"width": 1, "batch_size": 2, "steps": 1})


@dataclass(frozen=True)
class ScoresConfig:
    """Section `scores`: what the generative models are measured by.

    images: of each model. subsets, subset_size: of KID, whose spread is that over the subsets. neighbours: k of
    precision and recall. inception_weights: a file for torch-fidelity's Inception network; null: FID is not computed.
    auto_steps, auto_learning_rate: of latents that are optimised on each held-out shape. cloud_points: of every cloud.
    samples: of the prior, drawn and compared with the training shapes. cameras: around a shape, as far apart as they
    can be. textured: shapes with a texture of which the images are compared from these cameras.
    """

    features: FeaturesConfig
    images: int
    subsets: int
    subset_size: int
    neighbours: int
    inception_weights: Path | None
    auto_steps: int
    auto_learning_rate: float
    cloud_points: int
    samples: int
    cameras: int
    textured: int
    seed: int

    def __post_init__(self) -> None:
        least = {
            "images": 2,
            "subsets": 2,
            "subset_size": 2,
            "neighbours": 1,
            "auto_steps": 1,
            "auto_learning_rate": 1e-9,
        }
        require("scores", self, {**least, "cloud_points": 1, "samples": 2, "cameras": 2, "textured": 2, "seed": 0})
        if self.subset_size > self.images:
            raise checks.InputError(
                f"scores.subset_size must be <= scores.images; got {self.subset_size} and {self.images}"
            )


def auto_loop(scores: ScoresConfig) -> training_loop.LoopConfig:
    """How latents are optimised: as the feature network, at a rate of their own that falls to 0."""
    loop, rate = scores.features.loop, scores.auto_learning_rate
    return replace(loop, learning_rate=rate, schedule="cosine", warmup_steps=0, ema=None, muon=None)

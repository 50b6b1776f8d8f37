"""Settings of generative modelling: the sections `vae`, `gan` and `scores` of an experiment file.

Defaults are those of [DDF22] §4.4 and app. genmodel; what these leave open is chosen here and has no source.
"""

from dataclasses import dataclass, replace

from ddf.core import checks, schema
from ddf.core.schema import fixed, setting
from ddf.data.samples import sample_types
from ddf.fields import losses, pddf
from ddf.models import image_networks, loop_config

_GENMODEL = "app. genmodel"


@dataclass(frozen=True)
class VAEConfig(schema.Checked):
    """Section `vae`: the shape VAE. counts: as section `ddf` has them."""

    field: pddf.PDDFConfig = setting(pddf.PDDFConfig((512,) * 4 + (256,) * 4), "its decoder", _GENMODEL)
    latent_features: int = setting(400, "dim(z_s)", _GENMODEL, least=1)
    encoder_width: int = setting(64, "of PointNet", _GENMODEL, least=8)
    points: int = setting(1024, "with normals, that the encoder sees of a shape", _GENMODEL, least=2)
    held_out: int = setting(50, "shapes with samples that are not learned", least=1)
    batch_size: int = setting(32, "shapes of a step", _GENMODEL, least=2)
    steps: int = setting(100_000, "steps of training", _GENMODEL, least=1)
    counts: dict[str, int] = setting(
        {"U": 1200, "A": 1200, "B": 300, "S": 300, "T": 300, "O": 300, "E": 31},
        "oriented points per shape in a batch; E without truth, which the paper's VAE has not; with +: values alone",
        _GENMODEL,
    )
    weights: losses.LossWeights = setting(
        losses.LossWeights(eikonal_visibility=0.1, visibility_variance=0.1), "γ of its loss", _GENMODEL
    )
    beta: float = setting(0.05, "β of L_KL, the sum over the dimensions of z_s", _GENMODEL, least=0)
    loop: loop_config.LoopConfig = setting(loop_config.LoopConfig(schedule="constant"), "how it is optimised")
    encoder_learning_rate: float | None = setting(None, "of PointNet; null: that of the loop", _GENMODEL, above=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        sample_types.check_counts("counts", self.counts)


@dataclass(frozen=True)
class NormalsConfig(schema.Checked):
    """Normals of random shapes, rendered ahead. radius: of all cameras, benchmark units; the images have 0.65 to 1.

    elevation_deg: the cameras are spread evenly over that part of the sphere, azimuths over the whole circle.
    """

    images: int = setting(100_000, "how many; the paper renders anew in every step", least=1)
    elevation_deg: tuple[float, float] = setting((0.0, 90.0), "of the cameras; the paper's upper hemisphere", _GENMODEL)
    radius: float = fixed(0.8, least=0.1)
    seed: int = fixed(0, least=0)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "elevation_deg", tuple(self.elevation_deg))
        low, high = self.elevation_deg
        if not 0 <= low <= high <= 90:
            raise checks.InputError(f"elevation_deg must be two numbers in [0, 90], in order; got {[low, high]}")


@dataclass(frozen=True)
class GANConfig(schema.Checked):
    """Section `gan`: images from normals, and the 2D GAN that is compared with it. All are 64 x 64 pixels."""

    normals: NormalsConfig = setting(NormalsConfig(), "what f_T translates")
    texture_features: int = setting(64, "dim(z_T)", _GENMODEL, least=1)
    translator_width: int = setting(64, "of f_T and g_T", _GENMODEL, least=2)
    texture_width: int = setting(16, "of h_T", _GENMODEL, least=2)
    critic_width: int = setting(1024, "of the critics, and of the 2D GAN's generator", _GENMODEL, least=16)
    upsampling: image_networks.Upsampling = setting(
        "transposed", "of f_T and g_T; nearest leaves no grid of dots in short trainings", _GENMODEL
    )
    noise_features: int = setting(128, "of the 2D GAN", _GENMODEL, least=1)
    batch_size: int = setting(32, "images of a step, as GIRAFFE and pi-GAN have it", least=2)
    gradient_penalty: float = setting(10.0, "of E‖∇D‖² on real images", _GENMODEL, least=0)
    steps: int = setting(100_000, "of both GANs", _GENMODEL, least=1)
    loop: loop_config.LoopConfig = setting(loop_config.LoopConfig(), "how they are optimised", _GENMODEL)


@dataclass(frozen=True)
class FeaturesConfig(schema.Checked):
    """The image network whose features the scores of images are taken on, trained on the VAE's shapes."""

    width: int = setting(16, "of ResNet-20, which gives four times as many features", least=1)
    batch_size: int = setting(128, "images of a step", least=2)
    steps: int = setting(20_000, "steps of training", least=1)
    loop: loop_config.LoopConfig = fixed(loop_config.LoopConfig(3e-3, "cosine", 20, threads=1))


@dataclass(frozen=True)
class ScoresConfig(schema.Checked):
    """Section `scores`: what the generative models are measured by. The spread of KID is that over the subsets.

    samples: of the prior, drawn and compared with the training shapes.
    """

    features: FeaturesConfig = setting(FeaturesConfig(), "the image network that images are compared by")
    images: int = setting(10_000, "of each model; the paper's FID is of 50,000", least=2)
    subsets: int = setting(100, "of KID", least=2)
    auto_steps: int = setting(2000, "of latents that are optimised on each held-out shape", least=1)
    auto_learning_rate: float = fixed(0.03, above=0)
    cloud_points: int = setting(2466, "of every cloud", least=1)
    samples: int = fixed(12, least=2)
    seed: int = fixed(0, least=0)

    @property
    def subset_size(self) -> int:
        """Images of a subset of KID: its usual 1,000 of 2,500 and more, of fewer two fifths."""
        return max(2, min(1000, -(-2 * self.images // 5)))


def auto_loop(scores: ScoresConfig) -> loop_config.LoopConfig:
    """How latents are optimised: as the feature network, at a rate of their own that falls to 0."""
    loop, rate = scores.features.loop, scores.auto_learning_rate
    return replace(loop, learning_rate=rate, schedule="cosine", warmup_steps=0, ema=None, muon=None)

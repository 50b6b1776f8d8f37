"""Settings of single-image reconstruction: one dataclass per section of an experiment file, and their parts.

Defaults are the paper's. What it fixes and no experiment varies is a constant here.
"""

from dataclasses import dataclass, replace
from typing import Literal

from ddf.core import checks, schema
from ddf.core.schema import fixed, setting
from ddf.data.samples import sample_types
from ddf.fields import cloud_projection, losses, pddf, siren
from ddf.models import encoders, loop_config

CAMERA_NUMBERS = ("azimuth", "elevation", "radius")
Azimuth = Literal["angle", "sincos"]
CubePoints = Literal["random", "even", "farthest"]
CAMERA_WEIGHT = 5.0  # γ_RΠ; that of the shape, γ_RS, is 1. Source: [DDF22] app. E
WEIGHT_DECAY_SHAPE, WEIGHT_DECAY_CAMERA = 1e-3, 1e-6  # of the two encoders. Source: [DDF22] app. E

_DECODER = siren.SineLayout((512, 512, 512, 256, 256, 256, 256))
_SI3DR = "app. si3dr"


@dataclass(frozen=True)
class TrainConfig(schema.Checked):
    """Section `train`: what both models share. decoder: both have it, only their inputs and outputs differ."""

    image_size: int = setting(128, "pixels a side of the encoders' input", _SI3DR, least=32, most=1024)
    encoder: str = setting("resnet", "of `ddf.models.encoders`", _SI3DR)
    encoder_width: int = setting(64, "of both encoders' first layers; 64 is ResNet-18", _SI3DR, least=1)
    latent_features: int = setting(512, "size of the latent", _SI3DR, least=1)
    decoder: siren.SineLayout = setting(_DECODER, "of both decoders and their modulators", _SI3DR)
    batch_size: int = setting(32, "images of a step", _SI3DR, least=2)
    loop: loop_config.LoopConfig = setting(loop_config.LoopConfig(), "how both models are optimised")
    azimuth: Azimuth = setting("angle", "how it is predicted; sincos: (sin θ, cos θ), which have no end", _SI3DR)
    told: bool = setting(
        False, "the camera's encoder has the mask's numbers (`camera_encoder`), and half of the images mirrored", _SI3DR
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.encoder not in (known := encoders.ENCODERS):
            raise checks.InputError(f"train.encoder must be one of {', '.join(known)}; got {self.encoder!r}")


@dataclass(frozen=True)
class ProposalConfig(schema.Checked):
    """How many rays the field proposes per shape of a batch, see `proposed_rays`."""

    points: int = setting(160, "starts per shape", least=1)
    directions: int = fixed(2, least=1)  # candidates at each


@dataclass(frozen=True)
class FieldConfig(schema.Checked):
    """Section `ddf.field`: what the DDF's decoder has beside `train.decoder`, see `pddf.PDDFConfig`."""

    depth_activation: pddf.DepthActivation = setting("relu", "of depths; its gradient dies below zero", _SI3DR)
    depth_sharpness: float = setting(100.0, "β of softplus(βx)/β; relu has none", above=0)
    direction_scale: float = setting(1.0, "first weights of v, as a multiple of those of p; less fits faster", above=0)

    def of(self, layout: siren.SineLayout) -> pddf.PDDFConfig:
        """The whole field on a sine network of this layout."""
        own = self.depth_activation, self.depth_sharpness, self.direction_scale
        return pddf.PDDFConfig(layout.hidden, layout.omega_first, layout.omega_hidden, *own)


@dataclass(frozen=True)
class DDFConfig(schema.Checked):
    """Section `ddf`: field, loss and batch of the DDF model.

    counts: U+ A+ B+ S+ T+ (may be left out) are samples of these types that are supervised without derivatives.
    mask_pixels: drawn among those whose ray meets the box.
    """

    field: FieldConfig = setting(FieldConfig(), "its decoder, beside train.decoder")
    steps: int = setting(100_000, "steps of training", _SI3DR, least=1)
    learning_rate: float | None = setting(None, "in place of train.loop's, as high as PC-SIREN bears", _SI3DR, above=0)
    counts: dict[str, int] = setting(
        {"U": 1200, "A": 1200, "B": 300, "S": 300, "T": 300, "O": 300, "E": 31},
        "oriented points per shape in a batch; E without truth (1,000 a batch of single fits); with +: values alone",
        _SI3DR,
    )
    weights: losses.LossWeights = setting(losses.LossWeights(), "γ of the shape's loss")
    mask_weight: float = setting(10.0, "γ_RM of the mask's loss", _SI3DR, least=0)
    mask_size: int = setting(64, "pixels a side of its mask", _SI3DR, least=1)
    mask_pixels: int | None = setting(None, "of it that are drawn per image; null: all", _SI3DR, least=1)
    proposals: ProposalConfig | None = setting(
        None, "rays that the field itself would follow, cast while training; null: none", _SI3DR
    )
    muon: float | None = setting(None, "in place of train.loop's", _SI3DR, above=0)
    encoder_learning_rate: float | None = setting(
        None, "AdamW's for both encoders, whose features die at a field's rate; null: that one", _SI3DR, above=0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        sample_types.check_counts("counts", self.counts)

    def loop(self, common: loop_config.LoopConfig) -> loop_config.LoopConfig:
        """The loop that both models share, with this model's learning rates."""
        rate = common.learning_rate if self.learning_rate is None else self.learning_rate
        return replace(common, learning_rate=rate, muon=common.muon if self.muon is None else self.muon)

    def encoder_share(self, common: loop_config.LoopConfig) -> float:
        """The encoders' learning rate as a share of the decoder's, for `ReconstructionModel.parameter_groups`."""
        decoders = self.loop(common).learning_rate
        return 1.0 if self.encoder_learning_rate is None else self.encoder_learning_rate / decoders


@dataclass(frozen=True)
class PCSirenConfig(schema.Checked):
    """Section `pcsiren`: batch of the PC-SIREN model."""

    steps: int = setting(100_000, "steps of training", _SI3DR, least=1)
    points: int = setting(1024, "predicted per shape, for the Chamfer loss", _SI3DR, least=1)
    truth_points: int = setting(
        1024, "of the true cloud; few lie far from any prediction, which hides the error of the shape", _SI3DR, least=1
    )


@dataclass(frozen=True)
class CorrectionConfig(schema.Checked):
    """Gradient descent on L_M from Π̂.

    free: the mask alone cannot tell a far camera from a small shape, so an error of the estimated scale moves a free
    radius away from the better prediction.
    """

    steps: int = setting(100, "of Adam", least=0)
    learning_rate: float = setting(0.01, "Adam's, z-scores of the camera", above=0)
    mask_size: int = setting(64, "pixels a side of the mask", _SI3DR, least=1)
    free: tuple[str, ...] = setting(
        CAMERA_NUMBERS, "numbers of the camera that move; the mask shows the azimuth", "§4.3"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "free", tuple(self.free))
        if not self.free or not set(self.free) <= set(CAMERA_NUMBERS):
            raise checks.InputError(f"free must list some of {', '.join(CAMERA_NUMBERS)}; got {list(self.free)}")


@dataclass(frozen=True)
class ShapeCorrectionConfig(schema.Checked):
    """How latents descend.

    steps: each renders the mask and its gradient once. learning_rate: of the latent, in z-scores: how its
    numbers differ between training images. camera_rate: likewise of the camera. keep: weight of the mean squared
    z-score of the move, which holds the shape to the encoder's. mask_size: pixels a side.
    """

    steps: int = setting(20, "of Adam", least=1)
    learning_rate: float = fixed(0.03, above=0)
    camera_rate: float = fixed(0.03, least=0)
    keep: float = fixed(0.003, least=0)
    mask_size: int = fixed(32, least=1)


@dataclass(frozen=True)
class PointcloudsConfig(schema.Checked):
    """Section `pointclouds`: clouds and renders of the test images.

    shape_correction: clouds of the DDF beside the others, of latents moved until the shape's silhouette agrees with the
    image's alpha channel, with the predicted camera to start from.
    """

    cloud: cloud_projection.CloudConfig = setting(cloud_projection.CloudConfig(), "how clouds are drawn")
    correction: CorrectionConfig = setting(CorrectionConfig(), "of the camera, by the mask")
    large: int = setting(5000, "points of the clouds L", "table si3dr", least=1)
    small: int = setting(2466, "points of the clouds S", "table si3dr", least=1)
    test_views: int | None = setting(None, "images per test shape; null: those of the split", least=1)
    rendered: int = setting(12, "images to choose the report's examples from", least=0)
    render_size: int = setting(128, "pixels a side of these", least=1)
    seed: int = fixed(0, least=0)
    shape_correction: ShapeCorrectionConfig | None = setting(
        None, "shapes that descend on the mask with camera and scale, beside those as encoded; null: none", "§4.3"
    )
    public_views: int | None = setting(None, "the same of a shape of `ddf shapes`", least=1)
    pcsiren_inputs: CubePoints = setting(
        "random",
        "points of the cube that PC-SIREN maps; even: no gaps, no crowds; farthest: of twice as many even ones, those "
        "whose images are chosen by farthest-point order, as the DDF's are",
        _SI3DR,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.small > self.large:
            raise checks.InputError(f"small must be <= large; got {self.small} and {self.large}")

"""Settings of single-image reconstruction: one dataclass per section of an experiment file, and their parts."""

from dataclasses import dataclass, replace
from typing import Literal

from ddf.core import checks
from ddf.data.batches import varied_images
from ddf.data.samples import sample_types
from ddf.fields import cloud_projection, losses, pddf, siren
from ddf.models.encoders import catalogue
from ddf.training import training_loop

CAMERA_NUMBERS = ("azimuth", "elevation", "radius")
Azimuth = Literal["angle", "sincos"]
CubePoints = Literal["random", "even"]


@dataclass(frozen=True)
class TrainConfig:
    """Section `train`: what both models share.

    image_size: of the encoders' input. encoder, encoder_width: a name of `encoders.catalogue` and its first width; the
    paper's are resnet and 64, ResNet-18. decoder: hidden layers and frequencies of both
    decoders, of which only input and output differ. camera_weight: γ_RΠ.
    azimuth: `angle` is the paper's, `sincos` regresses (sin θ, cos θ), see `reconstruction_models.CameraHead`.
    augmentation: how training images are varied; null, the paper's way, for the images as they are.
    """

    image_size: int
    encoder_width: int
    latent_features: int
    decoder: siren.SineLayout
    batch_size: int
    camera_weight: float
    weight_decay_shape: float
    weight_decay_camera: float
    loop: training_loop.LoopConfig
    azimuth: Azimuth = "angle"
    augmentation: varied_images.AugmentationConfig | None = None
    encoder: str = "resnet"

    def __post_init__(self) -> None:
        for name, least in (("image_size", 32), ("encoder_width", 1), ("latent_features", 1), ("batch_size", 2)):
            if getattr(self, name) < least:
                raise checks.InputError(f"train.{name} must be >= {least}; got {getattr(self, name)}")
        if self.image_size > 1024:
            raise checks.InputError(f"train.image_size must be <= 1024; got {self.image_size}")
        for name in ("camera_weight", "weight_decay_shape", "weight_decay_camera"):
            if not getattr(self, name) >= 0:
                raise checks.InputError(f"train.{name} must be >= 0; got {getattr(self, name)}")
        catalogue.require(self.encoder)

    @property
    def encoders(self) -> tuple[int, Azimuth, str]:
        """What both models make their encoders by: `ReconstructionModel`."""
        return self.encoder_width, self.azimuth, self.encoder


@dataclass(frozen=True)
class ProposalConfig:
    """How many rays the field proposes per shape of a batch, and how; see `proposed_rays`.

    points: starts, of which the share `near` is at true surface points + σ N(0, I) with σ = `jitter` (field units),
    where later cycles of cloud drawing start, the rest uniform in the cube. directions: candidates at each.
    temperature, inverse_depth: η_T and ε_s, as in cloud drawing.
    """

    points: int
    directions: int
    near: float
    jitter: float
    temperature: float
    inverse_depth: float

    def __post_init__(self) -> None:
        for name in ("points", "directions"):
            if getattr(self, name) < 1:
                raise checks.InputError(f"ddf.proposals.{name} must be >= 1; got {getattr(self, name)}")
        for name in ("jitter", "temperature", "inverse_depth"):
            if not getattr(self, name) > 0:
                raise checks.InputError(f"ddf.proposals.{name} must be > 0; got {getattr(self, name)}")
        if not 0 <= self.near <= 1:
            raise checks.InputError(f"ddf.proposals.near must be in [0, 1]; got {self.near}")


@dataclass(frozen=True)
class FieldConfig:
    """Section `ddf.field`: what the DDF's decoder has beside `train.decoder`, see `pddf.PDDFConfig`."""

    depth_activation: pddf.DepthActivation
    depth_sharpness: float = 100.0
    direction_scale: float = 1.0
    components: int = 2

    def __post_init__(self) -> None:
        self.of(siren.SineLayout((1,), 1.0, 1.0))

    def of(self, layout: siren.SineLayout) -> pddf.PDDFConfig:
        """The whole field on a sine network of this layout."""
        return pddf.PDDFConfig(
            layout.hidden,
            layout.omega_first,
            layout.omega_hidden,
            self.depth_activation,
            self.depth_sharpness,
            self.direction_scale,
            self.components,
        )


@dataclass(frozen=True)
class DDFConfig:
    """Section `ddf`: field, loss and batch of the DDF model.

    counts: oriented points per shape and type in a batch, E the extra uniform ones; U+ A+ B+ S+ T+ (may be left out)
    are samples of these types that are supervised without derivatives. learning_rate, muon: in place of those in
    `train.loop`, null for those: the two models do not bear the same. encoder_learning_rate: AdamW's for the two
    encoders, null for that of the decoder: at rates that a field likes most of their features die. shape_weight: γ_RS.
    mask_weight: γ_RM. mask_size: side of the rendered mask. mask_pixels: pixels of it that are evaluated per image,
    drawn among those whose ray meets the box; null for all of them. proposals: rays that the field chooses itself; null
    for none. samples: those that are stored, the paper's way, or fresh ones in every step (`training_truth`).
    """

    field: FieldConfig
    steps: int
    learning_rate: float | None
    counts: dict[str, int]
    weights: losses.LossWeights
    shape_weight: float
    mask_weight: float
    mask_size: int
    mask_pixels: int | None
    proposals: ProposalConfig | None
    muon: float | None = None
    encoder_learning_rate: float | None = None
    samples: Literal["stored", "fresh"] = "stored"

    def __post_init__(self) -> None:
        sample_types.check_counts("ddf.counts", self.counts)
        if self.steps < 1 or self.mask_size < 1 or (self.mask_pixels is not None and self.mask_pixels < 1):
            raise checks.InputError("ddf.steps, ddf.mask_size and ddf.mask_pixels must be >= 1 (mask_pixels or null)")
        for name in ("learning_rate", "muon", "encoder_learning_rate"):
            rate = getattr(self, name)
            if rate is not None and not rate > 0:
                raise checks.InputError(f"ddf.{name} must be > 0, or null; got {rate}")
        if not (self.shape_weight >= 0 and self.mask_weight >= 0):
            raise checks.InputError("ddf.shape_weight and ddf.mask_weight must be >= 0")

    @property
    def casts(self) -> bool:
        """Whether a step casts rays against the training meshes."""
        return self.proposals is not None or self.samples == "fresh"

    def loop(self, common: training_loop.LoopConfig) -> training_loop.LoopConfig:
        """The loop that both models share, with this model's learning rates."""
        rate = common.learning_rate if self.learning_rate is None else self.learning_rate
        return replace(common, learning_rate=rate, muon=common.muon if self.muon is None else self.muon)

    def encoder_share(self, common: training_loop.LoopConfig) -> float:
        """The encoders' learning rate as a share of the decoder's, for `ReconstructionModel.parameter_groups`."""
        decoders = self.loop(common).learning_rate
        return 1.0 if self.encoder_learning_rate is None else self.encoder_learning_rate / decoders


@dataclass(frozen=True)
class PCSirenConfig:
    """Section `pcsiren`: batch of the PC-SIREN model.

    points: predicted per shape for the Chamfer loss. truth_points: of the true cloud that they are compared with; the
      paper has as many. Few true points lie far from any prediction: that distance hides the error of the shape.
    """

    steps: int
    points: int
    truth_points: int

    def __post_init__(self) -> None:
        for name in ("steps", "points", "truth_points"):
            if getattr(self, name) < 1:
                raise checks.InputError(f"pcsiren.{name} must be >= 1; got {getattr(self, name)}")


@dataclass(frozen=True)
class CorrectionConfig:
    """Gradient descent on L_M from Π̂: number of steps, Adam's learning rate in z-scores, mask size in pixels.

    free: what may change, of `CAMERA_NUMBERS`; all three is the paper's way. The mask alone cannot tell a far camera
    from a small shape, so an error of the estimated scale moves a free radius away from the better prediction.
    """

    steps: int
    learning_rate: float
    mask_size: int
    free: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "free", tuple(self.free))
        if not self.free or not set(self.free) <= set(CAMERA_NUMBERS):
            raise checks.InputError(
                f"pointclouds.correction.free must list some of {', '.join(CAMERA_NUMBERS)}; got {list(self.free)}"
            )
        if self.steps < 0 or self.mask_size < 1 or not self.learning_rate > 0:
            raise checks.InputError(
                f"pointclouds.correction: steps must be >= 0, mask_size >= 1, learning_rate > 0; got {self}"
            )


@dataclass(frozen=True)
class ShapeCorrectionConfig:
    """How latents descend.

    steps: of Adam; each renders the mask and its gradient once. learning_rate: of the latent, in z-scores: how its
    numbers differ between training images. camera_rate: likewise of the camera. keep: weight of the mean squared
    z-score of the move, which holds the shape to the encoder's. mask_size: pixels a side.
    """

    steps: int
    learning_rate: float
    camera_rate: float
    keep: float
    mask_size: int

    def __post_init__(self) -> None:
        if self.steps < 1 or self.mask_size < 1:
            raise checks.InputError(f"pointclouds.shape_correction: steps and mask_size must be >= 1; got {self}")
        if not (self.learning_rate > 0 and self.camera_rate >= 0 and self.keep >= 0):
            raise checks.InputError(
                "pointclouds.shape_correction: learning_rate must be > 0, camera_rate and keep >= 0; "
                f"got {self.learning_rate}, {self.camera_rate} and {self.keep}"
            )


@dataclass(frozen=True)
class PointcloudsConfig:
    """Section `pointclouds`.

    large, small: L and S, points of the two clouds (5,000 and 2,466 in the paper). test_views: views per test shape
    that are evaluated; null for those of the split. rendered: images whose visibility, depth and normals are rendered
    for the report, render_size pixels wide.
    shape_correction: clouds of the DDF beside the others, of latents moved until the shape's silhouette agrees with the
    image's alpha channel, with the predicted camera to start from; null, the paper's way, for none.
    pcsiren_inputs: the points of the cube that PC-SIREN maps to the surface (`cube_points`); random is the paper's way.
    """

    cloud: cloud_projection.CloudConfig
    correction: CorrectionConfig
    large: int
    small: int
    test_views: int | None
    rendered: int
    render_size: int
    seed: int
    shape_correction: ShapeCorrectionConfig | None = None
    pcsiren_inputs: CubePoints = "random"

    def __post_init__(self) -> None:
        if not 1 <= self.small <= self.large:
            raise checks.InputError(f"pointclouds needs 1 <= small <= large; got {self.small} and {self.large}")
        if self.rendered < 0 or self.render_size < 1 or self.seed < 0:
            raise checks.InputError("pointclouds.rendered and seed must be >= 0, render_size >= 1")
        if self.test_views is not None and self.test_views < 1:
            raise checks.InputError(f"pointclouds.test_views must be >= 1 or null; got {self.test_views}")

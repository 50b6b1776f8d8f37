"""One optimisation step of single-image reconstruction, for the DDF model and for PC-SIREN. [DDF22] §4.3, app. E."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from ddf.core import checks
from ddf.data import shapenet
from ddf.fields import losses, pddf, siren
from ddf.geometry import cameras
from ddf.reconstruction import category_data, reconstruction_models
from ddf.training import distributed, training_loop

GROUP = 32  # distances of which the least is found first, at most


@dataclass(frozen=True)
class TrainConfig:
    """Section `train`: what both models share.

    image_size: of the encoders' input. encoder_width: 64 is ResNet-18. camera_weight: γ_RΠ.
    train_views: the views of a training shape that are shown; null for those of the split.
    azimuth: `angle` is the paper's, `sincos` regresses (sin θ, cos θ), see `reconstruction_models.CameraHead`.
    step_shares: by category, multiples of the steps that each model's own section states; 1, the paper's way, where a
      category is not named. Of a small budget the hardest category can so have more, of both models alike.
    """

    image_size: int
    encoder_width: int
    latent_features: int
    batch_size: int
    train_views: int | None
    camera_weight: float
    weight_decay_shape: float
    weight_decay_camera: float
    loop: training_loop.LoopConfig
    azimuth: reconstruction_models.Azimuth = "angle"
    step_shares: dict[str, float] | None = None

    def __post_init__(self) -> None:
        for name, least in (("image_size", 32), ("encoder_width", 1), ("latent_features", 1), ("batch_size", 2)):
            if getattr(self, name) < least:
                raise checks.InputError(f"train.{name} must be >= {least}; got {getattr(self, name)}")
        if self.train_views is not None and not 1 <= self.train_views <= 24:
            raise checks.InputError(f"train.train_views must be in 1..24 or null; got {self.train_views}")
        for name in ("camera_weight", "weight_decay_shape", "weight_decay_camera"):
            if not getattr(self, name) >= 0:
                raise checks.InputError(f"train.{name} must be >= 0; got {getattr(self, name)}")
        for name, share in (self.step_shares or {}).items():
            if name not in shapenet.SYNSETS:
                raise checks.InputError(f"train.step_shares must name categories; got {name!r}")
            if not 0 < share < math.inf:
                raise checks.InputError(f"train.step_shares.{name} must be > 0 and finite; got {share}")

    def steps(self, stated: int, category: str) -> int:
        """How many of one category, of as many as a model's section states."""
        return max(1, round(stated * (self.step_shares or {}).get(category, 1.0)))


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
class DDFConfig:
    """Section `ddf`: field, loss and batch of the DDF model.

    counts: oriented points per shape and type in a batch, E the extra uniform ones; U+ A+ B+ S+ T+ (may be left out)
    are samples of these types that are supervised without derivatives. learning_rate, muon: in place of those in
    `train.loop`, null for those: the two models do not bear the same. encoder_learning_rate: AdamW's for the two
    encoders, null for that of the decoder: at rates that a field likes most of their features die. shape_weight: γ_RS.
    mask_weight: γ_RM. mask_size: side of the rendered mask. mask_pixels: pixels of it that are evaluated per image,
    drawn among those whose ray meets the box; null for all of them. proposals: rays that the field chooses itself; null
    for none. samples: those that are stored, the paper's way, or fresh ones in every step (`training_truth`).
    mirror_shapes: train on the mirror image of every shape too, about the plane with this normal, seen by flipped
    images (`mirrored_data`); null, the paper's way, for the shapes as they are.
    """

    field: pddf.PDDFConfig
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
    mirror_shapes: cameras.Mirror | None = None

    def __post_init__(self) -> None:
        losses.check_counts("ddf.counts", self.counts)
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
    """Section `pcsiren`: decoder and batch of the PC-SIREN model.

    points: predicted per shape for the Chamfer loss. truth_points: of the true cloud that they are compared with; the
      paper has as many. Few true points lie far from any prediction: that distance hides the error of the shape.
    mirror_shapes: as in section `ddf`.
    """

    hidden: tuple[int, ...]
    omega_first: float
    omega_hidden: float
    steps: int
    points: int
    truth_points: int
    mirror_shapes: cameras.Mirror | None = None

    def __post_init__(self) -> None:
        self.layout()
        for name in ("steps", "points", "truth_points"):
            if getattr(self, name) < 1:
                raise checks.InputError(f"pcsiren.{name} must be >= 1; got {getattr(self, name)}")

    def layout(self) -> siren.SineLayout:
        """Sizes and frequencies of the decoder."""
        return siren.SineLayout(self.hidden, self.omega_first, self.omega_hidden)


def ddf_model(train: TrainConfig, config: DDFConfig) -> reconstruction_models.DDFModel:
    """The DDF model of a config, freshly initialised."""
    return reconstruction_models.DDFModel(config.field, train.latent_features, train.encoder_width, train.azimuth)


def pcsiren_model(train: TrainConfig, config: PCSirenConfig) -> reconstruction_models.PCSirenModel:
    """The PC-SIREN model of a config, freshly initialised."""
    return reconstruction_models.PCSirenModel(
        config.layout(), train.latent_features, train.encoder_width, train.azimuth
    )


@runtime_checkable
class SampleSource(Protocol):
    """Gives the oriented points of a batch with their ground truth."""

    def draw(
        self,
        shapes: Int[np.ndarray, "b"],
        counts: Mapping[str, int],
        random: np.random.Generator,
        part: slice,
        /,
    ) -> losses.SampleBatch:
        """Points of every type for each of `part` of the shapes, drawn for all of them; E points have no truth."""
        ...


@runtime_checkable
class Proposer(Protocol):
    """Adds rays that the field chooses to the samples of a batch."""

    def __call__(
        self,
        stored: losses.SampleBatch,
        field: pddf.PDDF,
        modulations: Sequence[Float[Tensor, "b 1 _"]],
        chosen: Int[np.ndarray, "b"],
        random: np.random.Generator,
        part: slice,
        /,
    ) -> losses.SampleBatch:
        """The stored samples of `part` of the shapes `chosen`, with others behind them, drawn for all of `chosen`."""
        ...


@dataclass(frozen=True)
class Batch:
    """Images of one step with the cameras and shapes that they show; everything on the model's device.

    Of several processes (`distributed`) each has a part of the images, `part`, and what belongs to them; drawn: the
    shapes of all. `random` is the same everywhere: every process draws for all images and keeps what is its own.
    """

    part: slice
    drawn: np.ndarray
    rows: np.ndarray
    shapes: np.ndarray
    images: Float[Tensor, "b 4 size size"]
    cameras: Float[Tensor, "b 3"]
    random: np.random.Generator

    @classmethod
    def draw(cls, images: category_data.ImageSet, config: TrainConfig, step: int) -> "Batch":
        """Random images of step `step`, without repetition as long as there are enough."""
        random = np.random.default_rng((config.loop.seed, step))
        repeated = len(images.shapes) < config.batch_size
        rows = random.choice(len(images.shapes), config.batch_size, replace=repeated)
        part, place = distributed.part(config.batch_size), training_loop.device()
        drawn, rows = images.shapes[rows], rows[part]
        shown, poses = images.batch(rows).to(place), images.cameras[rows].to(place)
        return cls(part, drawn, rows, drawn[part], shown, poses, random)

    def chances(self, count: int) -> Float[Tensor, "b count"]:
        """Random numbers in [0, 1) for each image, made on the images' device."""
        place = self.images.device
        return torch.rand((len(self.drawn), count), generator=self.generator(place), device=place)[self.part]

    def generator(self, device: torch.device) -> torch.Generator:
        """Torch's own generator, seeded from this step's."""
        return torch.Generator(device).manual_seed(int(self.random.integers(2**62)))


def ddf_step(
    model: reconstruction_models.DDFModel,
    images: category_data.ImageSet,
    shapes: category_data.ShapeSet,
    samples: SampleSource,
    train: TrainConfig,
    config: DDFConfig,
    step: int,
    propose: Proposer | None = None,
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """γ_RS 𝔏_S + γ_RΠ L_Π + γ_RM L_M, the mask with the predicted camera and the true scale.

    Args:
      propose: adds the rays that the config's `proposals` ask for.
    """
    batch = Batch.draw(images, train, step)
    place = batch.images.device
    modulations = model.modulations(model.shape_encoder(batch.images))
    points = samples.draw(batch.drawn, config.counts, batch.random, batch.part).to(place)
    if propose is not None:
        points = propose(points, model.field, modulations, batch.drawn, batch.random, batch.part)
    shape_loss, terms = losses.shape_loss(model.field, points, modulations, config.weights, train.loop.matmul)
    scores = model.camera_encoder(batch.images)
    camera_loss = model.camera_head.loss(scores, batch.cameras)
    mask_loss = reconstruction_models.mask_loss(
        model.field,
        modulations,
        model.camera_head(scores),
        shapes.field_scales(batch.shapes).to(place),
        images.alpha(batch.rows, config.mask_size).to(place),
        config.mask_pixels,
        None if config.mask_pixels is None else batch.chances(config.mask_size**2),
    ).mean()
    total = config.shape_weight * shape_loss + train.camera_weight * camera_loss + config.mask_weight * mask_loss
    return total, {**terms, "camera": camera_loss.detach(), "mask": mask_loss.detach()}


def pcsiren_step(
    model: reconstruction_models.PCSirenModel,
    images: category_data.ImageSet,
    shapes: category_data.ShapeSet,
    train: TrainConfig,
    config: PCSirenConfig,
    step: int,
) -> tuple[Float[Tensor, ""], dict[str, Tensor]]:
    """D_C in the field frame + γ_RΠ L_Π."""
    batch = Batch.draw(images, train, step)
    place = batch.images.device
    clouds = [shapes.subset(int(i), config.truth_points, batch.random) for i in batch.drawn]
    truth = torch.stack(clouds[batch.part]).to(place)
    seeds = batch.random.uniform(-1, 1, (len(batch.drawn), config.points, 3))[batch.part].astype(np.float32)
    predicted = model.decoder(torch.from_numpy(seeds).to(place), model.shape_encoder(batch.images))
    chamfer = chamfer_loss(predicted, truth)
    camera_loss = model.camera_head.loss(model.camera_encoder(batch.images), batch.cameras)
    total = chamfer + train.camera_weight * camera_loss
    return total, {"chamfer": chamfer.detach(), "camera": camera_loss.detach()}


def chamfer_loss(predicted: Float[Tensor, "b n 3"], truth: Float[Tensor, "b m 3"]) -> Float[Tensor, ""]:
    """D_C: sum of the two means of squared distances to the nearest neighbour, mean over shapes.

    The neighbours are found without gradient; only the pairs that count are differentiated.
    """
    to_truth, to_predicted = _nearest(predicted.detach(), truth)
    near_truth = truth.gather(1, to_truth[..., None].expand(-1, -1, 3))
    near_predicted = predicted.gather(1, to_predicted[..., None].expand(-1, -1, 3))
    there = (predicted - near_truth).square().sum(-1).mean()
    return there + (truth - near_predicted).square().sum(-1).mean()


def _nearest(
    predicted: Float[Tensor, "b n 3"], truth: Float[Tensor, "b m 3"]
) -> tuple[Int[Tensor, "b n"], Int[Tensor, "b m"]]:
    """Index of the nearest true point of each predicted one, and the other way round, in blocks that stay in cache."""
    n, m = predicted.shape[1], truth.shape[1]
    block = losses.block_values(predicted.device)
    shapes, columns = max(1, block // (n * m)), max(1, block // n)
    to_truth, to_predicted = [], []
    for own, others in zip(predicted.split(shapes), truth.split(shapes), strict=True):
        nearest = torch.full(own.shape[:2], torch.inf, dtype=own.dtype, device=own.device)
        index = torch.zeros(own.shape[:2], dtype=torch.int64, device=own.device)
        back, start = [], 0
        for part in others.split(columns, dim=1):
            dist_sq = torch.baddbmm(
                own.square().sum(-1, keepdim=True) + part.square().sum(-1)[:, None], own, part.mT, alpha=-2
            )
            back.append(_argmin(dist_sq, 1)[1])
            least, place = _argmin(dist_sq, 2)
            index = torch.where(least < nearest, place + start, index)
            nearest = torch.minimum(least, nearest)
            start += part.shape[1]
        to_truth.append(index)
        to_predicted.append(torch.cat(back, dim=1))
    return torch.cat(to_truth), torch.cat(to_predicted)


def _argmin(values: Float[Tensor, "b n m"], dim: int) -> tuple[Float[Tensor, "b _"], Int[Tensor, "b _"]]:
    """The least along an axis and its index, the first of several: of groups first, as values alone are found some
    seven times as fast as with their index.
    """
    size = math.gcd(values.shape[dim], GROUP)
    groups = values.unflatten(dim, (-1, size))
    chosen = groups.amin(dim + 1).argmin(dim).unsqueeze(dim)
    least, place = groups.take_along_dim(chosen.unsqueeze(dim + 1), dim).min(dim + 1)
    return least.squeeze(dim), (chosen * size + place).squeeze(dim)

"""A directed distance field that asks the image at places along the line (derived here; features by projection as in
PIFu, Saito et al. 2019, and pixelNeRF, Yu et al. 2021).

A shape latent holds what an encoder could say of the whole image at once; thin parts that the image shows are lost in
it. Here N places are fixed on the line of a ray (p, v), between its entry into a box that holds all shapes of the
category and its exit. Each asks a map of image features where the camera sees it, and where the camera sees its mirror
image in z = 0. A small network gives the logit of a surface in that part of the line, and where in the part. The parts
ahead of p make a probabilistic DDF of N components [DDF22 §3.3]: with a_k the chance of a surface in part k,
  w_k = a_k Π_{j<k} (1 - a_j),  ξ = 1 - Π_k (1 - a_k),  d the depth of the heaviest part.
Places do not move with p, so d(p + δv, v) = d(p, v) - δ by construction wherever the same part stays the heaviest: the
eikonal equation of a DDF, and all surfaces of a line at once. Of several images of one shape the logits are averaged.

What projects on transparent pixels is empty: such places are not evaluated (they are most of the box).

The field frame is twice v1 (`transforms`): every shape lies in [-1, 1]^3, and no scale has to be told or guessed.
"""

import dataclasses
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn
from torch.nn import functional

from ddf.core import schema, storage
from ddf.core.schema import setting
from ddf.data.batches import category_data
from ddf.fields import field_outputs, framed_field, model_files
from ddf.geometry import cameras, transforms
from ddf.models import encoders, loop_config, out_of_distribution, reconstruction_models, reconstruction_settings

KIND = "ddf_image"  # of its files
FIELD_FROM_V1 = 2.0
BENCHMARK_FROM_FIELD = transforms.BENCHMARK_FROM_V1 / FIELD_FROM_V1
CHANNELS, WIDTHS = 32, (32, 64, 96, 128)  # of the map; of the encoder, each at half the size of the one before
OCTAVES = 6  # of the sines of a place
RAYS = {"U": 3, "A": 3, "B": 6, "S": 12, "T": 12}  # types of a batch: one in so many
EMPTY = -8.0  # logit of a part that is not evaluated, or lies behind p
OPAQUE = 0.02  # least alpha of a pixel that may show the object
MARGIN = 0.1  # field units, around the shapes of the training set
_CHUNK = 2048  # rays at a time: memory and speed alone
_STEEPEST = 1e-6  # direction's component below which a line is parallel to a face


@dataclass(frozen=True)
class LineFieldConfig(schema.Checked):
    """Section `ddf_image`: the decoder, its batch and how it is optimised."""

    places: int = setting(32, "N, fixed on the line across the box", least=2)
    width: int = setting(96, "of the decoder's three layers", least=1)
    steps: int = setting(100_000, "steps of training", least=1)
    learning_rate: float = setting(2e-3, "AdamW's, in place of train.loop's", above=0)
    rays: int = setting(200, "oriented points per shape in a batch, of the types of `RAYS`", least=12)
    camera_noise: float = setting(0.5, "of the cameras in training, as a multiple of a camera encoder's error", least=0)

    def counts(self) -> dict[str, int]:
        """Oriented points of each type; none without truth."""
        return {"E": 0, **{name: self.rays // share for name, share in RAYS.items()}}

    def loop(self, common: loop_config.LoopConfig) -> loop_config.LoopConfig:
        """The loop of all models, with this one's learning rate."""
        return replace(common, learning_rate=self.learning_rate)


class Views(NamedTuple):
    """What the encoder makes of k images of each of b shapes.

    features: the maps. images: the pixels themselves, for what is thinner than a feature. context: a vector of each.
    cameras: azimuth, elevation (radians), radius (benchmark units). opaque: where the object may be seen, one pixel
    wider than it is.
    """

    features: Float[Tensor, "b k c h w"]
    images: Float[Tensor, "b k 4 s s"]
    context: Float[Tensor, "b k g"]
    cameras: Float[Tensor, "b k 3"]
    opaque: Float[Tensor, "b k s s"]

    def of_one_shape(self, rows: Sequence[int] | slice = slice(None)) -> "Views":
        """Single views of k shapes, or of some of them, as the views of one shape."""
        return Views(*(part[rows].transpose(0, 1) for part in self))


@dataclass(frozen=True)
class Parts:
    """What the field says of the parts of each line.

    hits: distance along v from p to the surface in each part, negative behind p. logits: of a surface there. ahead:
    parts that count for the ray from p. step: length of a part, field units.
    """

    hits: Float[Tensor, "b n N"]
    logits: Float[Tensor, "b n N"]
    entry: Float[Tensor, "b n"]
    step: Float[Tensor, "b n"]

    def log_weights(self) -> tuple[Float[Tensor, "b n N"], Float[Tensor, "b n"]]:
        """log w_k of the ray from p, and log (1 - ξ)."""
        logits = torch.where(self.hits.detach() > 0, self.logits, EMPTY)
        free = functional.logsigmoid(-logits)
        through = free.cumsum(-1)
        return functional.logsigmoid(logits) + through - free, through[..., -1]


class FeatureEncoder(encoders.Encoder):
    """An RGBA image to a map of features at half its size and a vector: a small U-Net (Ronneberger et al. 2015)."""

    def __init__(self, out_features: int) -> None:
        super().__init__()
        inputs, outputs = (encoders.IMAGE_CHANNELS, *WIDTHS[:-1]), (*WIDTHS[-2:0:-1], CHANNELS)
        self.down = nn.ModuleList(_Block(*widths, 2) for widths in zip(inputs, WIDTHS, strict=True))
        joined = zip((WIDTHS[-1], *outputs), WIDTHS[-2::-1], outputs, strict=False)
        self.up = nn.ModuleList(_Block(below + level, found) for below, level, found in joined)
        self.fc = nn.Linear(WIDTHS[-1], out_features)

    def _levels(self, images: Float[Tensor, "b 4 h w"]) -> list[Tensor]:
        levels = [images]
        for block in self.down:
            levels.append(block(levels[-1]))
        return levels[1:]

    def stages(self, images: Float[Tensor, "b 4 h w"]) -> tuple[Float[Tensor, "b _"], ...]:
        """Pooled features of the last two levels."""
        return tuple(level.mean(dim=(-2, -1)) for level in self._levels(images)[-2:])

    def look(self, images: Float[Tensor, "b 4 h w"]) -> tuple[Float[Tensor, "b c h2 w2"], Float[Tensor, "b g"]]:
        """The map and the vector of each image."""
        levels = self._levels(images)
        found = levels[-1]
        for block, level in zip(self.up, levels[-2::-1], strict=True):
            larger = functional.interpolate(found, size=level.shape[-2:], mode="bilinear", align_corners=False)
            found = block(torch.cat((larger, level), dim=1))
        return found, self.fc(levels[-1].mean(dim=(-2, -1)))


class _Block(nn.Module):
    """Two convolutions around which the input is added, normalised by groups: batches are small."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__()
        self.first = nn.Conv2d(inputs, outputs, 3, stride, 1)
        self.second = nn.Conv2d(outputs, outputs, 3, 1, 1)
        self.norms = nn.ModuleList([nn.GroupNorm(4, outputs), nn.GroupNorm(4, outputs)])
        same = inputs == outputs and stride == 1
        self.skip = nn.Identity() if same else nn.Conv2d(inputs, outputs, 1, stride)

    def forward(self, images: Float[Tensor, "b i h w"]) -> Float[Tensor, "b o h2 w2"]:
        hidden = functional.relu(self.norms[0](self.first(images)))
        return functional.relu(self.skip(images) + self.norms[1](self.second(hidden)))


class LineDecoder(nn.Module):
    """Parts of lines from looks at the images. lower, upper: the box that holds the category, field frame."""

    lower: Tensor
    upper: Tensor

    def __init__(self, config: LineFieldConfig, context: int) -> None:
        super().__init__()
        self.places = config.places
        seen = CHANNELS + encoders.IMAGE_CHANNELS
        self.first = nn.Linear(2 * seen + 3 * (1 + 2 * OCTAVES) + 3 + 3 + 1, config.width)
        self.hidden = nn.ModuleList(nn.Linear(config.width, config.width) for _ in range(2))
        self.context = nn.Linear(context, 3 * config.width)
        self.head = nn.Linear(config.width, 2)
        nn.init.constant_(self.head.bias, -2.0)
        self.register_buffer("lower", torch.full((3,), -1.0))
        self.register_buffer("upper", torch.ones(3))

    def fit_box(self, reach: Float[Tensor, "3"]) -> None:
        """Take the box from the largest |x|, |y|, |z| of the training shapes, field frame."""
        self.upper.copy_((reach + MARGIN).clamp(max=1.0))
        self.lower.copy_(-self.upper)

    def span(
        self, positions: Float[Tensor, "*b 3"], directions: Float[Tensor, "*b 3"]
    ) -> tuple[Float[Tensor, "*b"], Float[Tensor, "*b"], Bool[Tensor, "*b"]]:
        """Distance along v to the line's entry into the box, length of a part, and whether it meets the box."""
        parallel = directions.abs() < _STEEPEST
        inverse = 1 / torch.where(parallel, torch.full_like(directions, _STEEPEST), directions)
        one, other = (self.lower - positions) * inverse, (self.upper - positions) * inverse
        entry, end = torch.minimum(one, other).amax(-1), torch.maximum(one, other).amin(-1)
        meets = end > entry
        return torch.where(meets, entry, 0.0), torch.where(meets, end - entry, 1.0) / self.places, meets

    def forward(
        self,
        views: Views,
        positions: Float[Tensor, "b n 3"],
        directions: Float[Tensor, "b n 3"],
        until: Float[Tensor, "b n"] | None = None,
    ) -> Parts:
        """All parts of the lines through oriented points, field frame; with `until` those of the rays up to there: what
        lies behind p or beyond is not asked, and taken for empty.
        """
        entry, step, meets = self.span(positions, directions)
        numbers = torch.arange(self.places, dtype=entry.dtype, device=entry.device)
        middle = entry[..., None] + (numbers + 0.5) * step[..., None]
        at = positions[..., None, :] + middle[..., None] * directions[..., None, :]
        asked = self._may_hold(views, at.detach(), meets)
        if until is not None:
            asked &= (middle + 0.5 * step[..., None] > 0) & (
                numbers <= part_of(until, entry, step).clamp_min(0)[..., None]
            )
        shape, kept = middle.shape, asked.flatten().nonzero()[:, 0]
        line = kept // self.places
        answers = self.answers(views, line // shape[1], at.flatten(0, 2)[kept], directions.flatten(0, 1)[line])
        empty = middle.new_tensor([EMPTY, 0.5]).expand(shape.numel(), 2)
        logits, places = empty.index_copy(0, kept, answers).view(*shape, 2).unbind(-1)
        return Parts(middle + (places - 0.5) * step[..., None], logits, entry, step)

    def _may_hold(
        self, views: Views, at: Float[Tensor, "b n N 3"], meets: Bool[Tensor, "b n"]
    ) -> Bool[Tensor, "b n N"]:
        """Places on lines that meet the box, where every view may see the object."""
        may, rows = meets[..., None].expand(at.shape[:-1]), torch.arange(len(at), device=at.device)
        rows = rows[:, None, None].expand(may.shape)
        for view in range(views.cameras.shape[1]):
            pixels, _ = self._pixels(views, view, rows.flatten(), at.flatten(0, 2))
            opaque = _asked(views.opaque[:, view, None], rows.flatten(), pixels, "nearest")[:, 0]
            may = may & (opaque > 0).view(may.shape)
        return may

    def answers(
        self, views: Views, row: Int[Tensor, "m"], at: Float[Tensor, "m 3"], directions: Float[Tensor, "m 3"]
    ) -> Float[Tensor, "m 2"]:
        """Logit of a surface in the part around each place, and where in the part it is, 0 to 1: means of all views of
        the shape `row` of each.
        """
        turns = at[..., None] * (math.pi * 2.0 ** torch.arange(OCTAVES, dtype=at.dtype, device=at.device))
        own = (at, directions, turns.sin().flatten(-2), turns.cos().flatten(-2))
        mirrored, found = at * at.new_tensor([1.0, 1.0, -1.0]), []
        for view in range(views.cameras.shape[1]):
            pixels, depth = self._pixels(views, view, row, at)
            other, maps = self._pixels(views, view, row, mirrored)[0], (views.features[:, view], views.images[:, view])
            looks = (_asked(each, row, place) for place in (pixels, other) for each in maps)
            rotation = cameras.rotation(views.cameras[:, view, 0], views.cameras[:, view, 1])
            along = (rotation[row] @ directions[:, :, None])[..., 0]
            inputs = torch.cat((*looks, *own, along, depth[:, None]), dim=-1)
            shifts = self.context(views.context[:, view]).chunk(3, dim=-1)
            hidden = functional.relu(self.first(inputs) + shifts[0][row])
            for layer, shift in zip(self.hidden, shifts[1:], strict=True):
                hidden = functional.relu(layer(hidden) + shift[row])
            found.append(self.head(hidden))
        answer = found[0] if len(found) == 1 else torch.stack(found).mean(dim=0)
        return torch.stack((answer[:, 0], answer[:, 1].sigmoid()), dim=-1)

    def depth_gradient(
        self, views: Views, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"], part: Int[Tensor, "n"]
    ) -> Float[Tensor, "n 3"]:
        """∇_p d, exact, of the surface in one part of each line of one shape; that part alone is evaluated."""
        with torch.enable_grad():
            start = positions.detach().requires_grad_()
            entry, step, _ = self.span(start, directions)
            middle = entry + (part + 0.5) * step
            at = start + middle[:, None] * directions
            row = torch.zeros_like(part)
            hits = middle + (self.answers(views, row, at, directions)[:, 1] - 0.5) * step
            return torch.autograd.grad(hits.sum(), start)[0]

    def _pixels(
        self, views: Views, view: int, row: Int[Tensor, "m"], at: Float[Tensor, "m 3"]
    ) -> tuple[Float[Tensor, "m 2"], Float[Tensor, "m"]]:
        """Where a camera sees places, -1 to 1 across the image; and how far behind its object's middle, field units."""
        camera = views.cameras[:, view]
        rotation, centre = cameras.extrinsics(*camera.unbind(-1))
        seen = (rotation[row] @ (at * BENCHMARK_FROM_FIELD - centre[row])[:, :, None])[..., 0]
        ahead = -seen[:, 2]
        scale = cameras.FOCAL_PX / cameras.CENTRE_PX / ahead
        pixels = torch.stack((seen[:, 0] * scale, -seen[:, 1] * scale), dim=-1)
        return pixels, (ahead - camera[row, 2]) / BENCHMARK_FROM_FIELD


def part_of(depth: Float[Tensor, "*b"], entry: Float[Tensor, "*b"], step: Float[Tensor, "*b"]) -> Float[Tensor, "*b"]:
    """Number of the part of a line that a depth lies in."""
    return ((depth - entry) / step).floor()


def _asked(
    maps: Float[Tensor, "b c h w"], row: Int[Tensor, "m"], pixels: Float[Tensor, "m 2"], how: str = "bilinear"
) -> Float[Tensor, "m c"]:
    """Values of each map at its own pixels; 0 outside. Maps stand one above the other, an empty line between."""
    padded = functional.pad(maps, (1, 1, 1, 1))
    tall = padded.transpose(0, 1).flatten(1, 2)[None]
    height, width = maps.shape[-2:]
    inside = pixels.clamp(-1 - 1 / height, 1 + 1 / height)
    x = inside[:, 0] * width / (width + 2)
    y = ((inside[:, 1] + 1) * height / 2 + 1 + row * (height + 2)) * 2 / tall.shape[2] - 1
    found = functional.grid_sample(tall, torch.stack((x, y), dim=-1)[None, None], mode=how, align_corners=False)
    return found[0, :, 0].T


class ImageDDFModel(reconstruction_models.ReconstructionModel):
    """Single-image reconstruction with image features along the ray; cameras as in the other models."""

    decoder: LineDecoder
    shape_encoder: FeatureEncoder

    def __init__(self, train: reconstruction_settings.TrainConfig, config: LineFieldConfig) -> None:
        super().__init__(LineDecoder(config, train.latent_features), train)

    @staticmethod
    def encoder_of(train: reconstruction_settings.TrainConfig) -> FeatureEncoder:
        """The encoder of shapes, not trained yet."""
        return FeatureEncoder(train.latent_features)

    def fit_box(self, shapes: category_data.ShapeSet) -> None:
        """Take the box from the true clouds of the training shapes."""
        reach = torch.zeros(3)
        for row in range(len(shapes.ids)):
            back = shapes.similarities[row].inverse()
            cloud = shapes.cloud(row) * back.scale + torch.from_numpy(back.translation).float()
            reach = torch.maximum(reach, FIELD_FROM_V1 * cloud.abs().amax(dim=0))
        self.decoder.fit_box(reach)

    def views(self, images: Float[Tensor, "b 4 s s"], seen_from: Float[Tensor, "b 3"]) -> Views:
        """One image of each shape."""
        features, context = self.shape_encoder.look(images)
        opaque = functional.max_pool2d((images[:, 3:] > OPAQUE).to(images), 3, 1, 1)
        return Views(features[:, None], images[:, None], context[:, None], seen_from[:, None], opaque)


@dataclass(frozen=True)
class ImageField:
    """The field of one shape by its images: a `framed_field.FramedField` in the frame of v1.

    lower, upper: corners of a box that holds the shape, field frame; that of the category will do.
    """

    decoder: LineDecoder
    views: Views
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]

    @classmethod
    def of(cls, decoder: LineDecoder, views: Views) -> "ImageField":
        """In the box of the category."""
        return cls(decoder, views, *(side.double().cpu().numpy() for side in (decoder.lower, decoder.upper)))

    @property
    def field_from_mesh(self) -> transforms.Similarity:
        """From v1."""
        return transforms.Similarity(FIELD_FROM_V1)

    @property
    def outputs(self) -> tuple[str, ...]:
        """What it can be asked for."""
        return field_outputs.DEFAULT

    @torch.no_grad()
    def parts(
        self, positions: Float[Tensor, "n 3"], directions: Float[Tensor, "n 3"], until: float | None = None
    ) -> Parts:
        """Parts of the lines through oriented points, field frame, as of the decoder: one shape, so b = 1."""
        found = []
        for at, along in zip(positions.split(_CHUNK), directions.split(_CHUNK), strict=True):
            far = None if until is None else at.new_full((1, len(at)), until)
            found.append(self.decoder(self.views, at[None], along[None], far))
        return Parts(*(torch.cat([getattr(each, f.name) for each in found], dim=1) for f in dataclasses.fields(Parts)))

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs inside the box, field frame; float32."""
        at, along = (torch.from_numpy(values).to(self.decoder.lower) for values in (positions, directions))
        parts = self.parts(at, along, until=math.inf)
        weights, missed = parts.log_weights()
        heaviest = weights.argmax(-1, keepdim=True)
        found = {"visibility": 1 - missed.exp(), "depth": parts.hits.gather(-1, heaviest)[..., 0]}
        if "normals" in outputs:  # ∇_p d / ‖∇_p d‖, which faces back, for v·∇_p d = -1. [DDF22] eq. 3
            chunks = zip(*(each.split(_CHUNK) for each in (at, along, heaviest[0, :, 0])), strict=True)
            gradients = torch.cat([self.decoder.depth_gradient(self.views, *each) for each in chunks])
            found["normals"] = functional.normalize(gradients, dim=-1)[None]
        return {name: found[name][0].cpu().numpy() for name in outputs}


class TrainedImageDDF(NamedTuple):
    """The model in evaluation mode, the image size that it takes, and the statistics of its training images."""

    network: ImageDDFModel
    image_size: int
    statistics: out_of_distribution.TrainingStatistics | None


def load(folder: Path) -> TrainedImageDDF:
    """The model of a folder, or of its file; errors are those of `reconstruction_models.load_ddf`."""
    folder, train, section = reconstruction_models.recorded(folder, KIND)
    from ddf.core import config  # needs yaml, which training and inference do without

    with framed_field.record_of(folder):
        how = config.recorded(section, LineFieldConfig, "ddf_image")
    network = model_files.built(lambda: ImageDDFModel(train, how), folder, out_of_distribution.PREFIX)
    return TrainedImageDDF(network, train.image_size, out_of_distribution.TrainingStatistics.read(folder))


def load_any(folder: Path) -> TrainedImageDDF | reconstruction_models.TrainedDDF:
    """The DDF of a folder, with image features or with a latent, as its file says; errors are those of `load`."""
    kind = storage.load_metadata(folder / model_files.MODEL).get("kind")
    return load(folder) if kind == KIND else reconstruction_models.load_ddf(folder)

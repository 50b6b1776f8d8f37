"""What is exported: torch modules with named inputs and outputs, around the networks of `fields` and `models`.

A graph computes what the package itself computes, by the same functions; `onnx_export` turns it into a file and
`onnx_parity` compares the two. Letters: n oriented points or images, the one free axis; k examples; z latent; s image
side.
"""

import types
from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn
from torch.nn import functional

from ddf.fields import field_outputs, pddf, siren
from ddf.fields.field_outputs import OUTPUTS
from ddf.fields.field_values import FieldValues
from ddf.geometry import cameras
from ddf.models import line_field, reconstruction_models
from ddf.models.encoders import IMAGE_CHANNELS

DYNAMIC = "n"  # the name of the axis whose length is free


class Graph(nn.Module):
    """What every graph declares.

    what: one sentence for the file. inputs: name to shape, the free axis called `n`. meanings: of the outputs, in
    order. tolerances: of the outputs. relative: outputs whose differences are divided by max(1, |value|).
    largest_batch: of a check; None for any. may_be_empty: whether n may be 0. examples: of inputs that an encoder
    gives, for the check, each with k rows that belong together.
    """

    what: str
    inputs: dict[str, tuple[int | str, ...]]
    meanings: dict[str, str]
    tolerances: dict[str, float]
    largest_batch: int | None = None
    relative: frozenset[str] = frozenset()
    may_be_empty: bool = True
    examples: Mapping[str, Tensor] = types.MappingProxyType({})

    def values(self, inputs: Mapping[str, Tensor]) -> FieldValues | None:
        """The field at the inputs, where the graph holds one."""
        return None

    def clear(self, inputs: Mapping[str, Tensor]) -> dict[str, Bool[Tensor, "n"]]:
        """Per output of a field, the rows where a difference means a fault; other outputs are continuous everywhere."""
        values = self.values(inputs)
        return (
            {} if values is None else {name: OUTPUTS[name].clear(values) for name in self.meanings if name in OUTPUTS}
        )


class FieldGraph(Graph):
    """A field, conditional where a modulator is given: positions, directions[, latent] to chosen outputs or to all."""

    def __init__(
        self,
        field: pddf.PDDF,
        outputs: Sequence[str] | None,
        modulator: siren.Modulator | None = None,
        latents: Float[Tensor, "k z"] | None = None,
    ) -> None:
        super().__init__()
        self.field, self.modulator = field, modulator
        self.outputs = field_outputs.require(outputs or tuple(OUTPUTS))
        self.inputs = {"positions": (DYNAMIC, 3), "directions": (DYNAMIC, 3)}
        self.what = "directed distance field of one shape: oriented points to visibility, depth and more"
        if modulator is not None:
            assert latents is not None  # examples for the check
            self.examples = {"latent": latents}
            self.inputs["latent"] = (1, latents.shape[-1])
            self.what = "directed distance field conditioned on the latent of a shape"
        self.meanings = {name: OUTPUTS[name].meaning for name in self.outputs}
        self.tolerances = {name: OUTPUTS[name].tolerance for name in self.outputs}
        self.relative = frozenset(name for name in self.outputs if OUTPUTS[name].relative)

    def values(self, inputs: Mapping[str, Tensor]) -> FieldValues:
        """The field at the inputs."""
        return self._at(*(inputs[name] for name in self.inputs))

    def _at(self, positions: Tensor, directions: Tensor, latent: Tensor | None = None) -> FieldValues:
        modulations = None
        if self.modulator is not None and latent is not None:
            modulations = [modulation.squeeze(-2) for modulation in self.modulator(latent)]
        return FieldValues(self.field, positions, directions, modulations, (*self.outputs, "normals"))

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """The outputs in order."""
        values = self._at(*inputs)
        return tuple(OUTPUTS[name].compute(values) for name in self.outputs)


class EncodersGraph(Graph):
    """Both encoders of a reconstruction model: RGBA images to latents and cameras."""

    what = "encoders: RGBA images to the latent of the shape and to the camera"
    largest_batch = 64  # images, not points

    def __init__(self, model: reconstruction_models.ReconstructionModel, image_size: int) -> None:
        super().__init__()
        self.shape_encoder, self.camera_encoder = model.shape_encoder, model.camera_encoder
        self.camera_head = model.camera_head
        self.inputs = {"images": (DYNAMIC, IMAGE_CHANNELS, image_size, image_size)}
        self.meanings = {
            "latent": "latent of the shape, input of the field",
            "camera": "azimuth and elevation in radians, radius in benchmark units",
        }
        self.tolerances = {"latent": 1e-4, "camera": 1e-4}

    def forward(self, images: Float[Tensor, "n 4 s s"]) -> tuple[Tensor, Tensor]:
        """Latents and cameras."""
        return self.shape_encoder(images), self.camera_head(self.camera_encoder(images))


class ViewsGraph(Graph):
    """The encoders of a model with image features: RGBA images to `line_field.Views`, without the images."""

    what = "encoders: RGBA images to maps of features, a vector, where the object may be seen, and the camera"
    largest_batch = 16  # images, not points
    may_be_empty = False  # norms by groups take no empty batch
    relative = frozenset({"features", "context"})

    def __init__(self, model: line_field.ImageDDFModel, image_size: int) -> None:
        super().__init__()
        self.model = model
        self.inputs = {"images": (DYNAMIC, IMAGE_CHANNELS, image_size, image_size)}
        self.meanings = {
            "features": "map of features, half as large as the image",
            "context": "a vector of the image",
            "opaque": "1 where the object may be seen, else 0",
            "camera": "azimuth and elevation in radians, radius in benchmark units",
        }
        self.tolerances = dict.fromkeys(self.meanings, 1e-4)

    def forward(self, images: Float[Tensor, "n 4 s s"]) -> tuple[Tensor, ...]:
        """The parts of the views in order."""
        views = self.model.views(images, self.model.camera_head(self.model.camera_encoder(images)))
        return tuple(part[:, 0] for part in (views.features, views.context, views.opaque, views.cameras))


class RaysGraph(Graph):
    """The decoder of a model with image features: an image, what `ViewsGraph` makes of it, and oriented points.

    All places are evaluated, and those that project on transparent pixels or lie behind p emptied afterwards: a graph
    has no use for fewer rows.
    """

    what = "directed distance field of the shape in one image: oriented points to visibility and depth"
    largest_batch = 4096  # points, times the places of a line
    may_be_empty = False

    def __init__(self, model: line_field.ImageDDFModel, image_size: int) -> None:
        super().__init__()
        self.decoder = model.decoder
        images = example_images(3, image_size, torch.Generator().manual_seed(0))
        encoded = ViewsGraph(model, image_size)
        with torch.no_grad():
            self.examples = {"image": images, **dict(zip(encoded.meanings, encoded(images), strict=True))}
        self.inputs = {name: (1, *values.shape[1:]) for name, values in self.examples.items()}
        self.inputs |= {"positions": (DYNAMIC, 3), "directions": (DYNAMIC, 3)}
        self.meanings = {name: OUTPUTS[name].meaning for name in ("visibility", "depth")}
        self.tolerances = dict.fromkeys(self.meanings, 1e-4)

    def clear(self, inputs: Mapping[str, Tensor]) -> dict[str, Bool[Tensor, "n"]]:
        """Rows that stay as they are when p moves by rounding: no other part is as heavy, no pixel changes."""
        parts, positions = self._parts(*inputs.values()), inputs["positions"]
        here, weights = self._seen(parts), parts.log_weights()[0][0]
        first, second = weights.topk(2, dim=-1).values.unbind(-1)
        clear = ((first - second > _APART) | (first < line_field.EMPTY / 2)) & (first > _LEAST)
        for corner in _TETRAHEDRON:
            moved = {**inputs, "positions": positions + _ROUNDING * positions.new_tensor(corner)}
            for one, other in zip(here, self(*moved.values()), strict=True):
                clear &= (one - other).abs() < _STEADY
        return dict.fromkeys(self.meanings, clear)

    def forward(self, *inputs: Tensor) -> tuple[Tensor, Tensor]:
        """Visibility, and depth of the heaviest part."""
        return self._seen(self._parts(*inputs))

    @staticmethod
    def _seen(parts: line_field.Parts) -> tuple[Tensor, Tensor]:
        weights, missed = parts.log_weights()
        return 1 - missed.exp()[0], parts.hits[0].gather(-1, weights[0].argmax(-1, keepdim=True))[:, 0]

    def _parts(
        self,
        image: Float[Tensor, "1 4 s s"],
        features: Float[Tensor, "1 c h w"],
        context: Float[Tensor, "1 g"],
        opaque: Float[Tensor, "1 s s"],
        camera: Float[Tensor, "1 3"],
        positions: Float[Tensor, "n 3"],
        directions: Float[Tensor, "n 3"],
    ) -> line_field.Parts:
        """Of the lines through the points."""
        views = line_field.Views(*(part[:, None] for part in (features, image, context, camera, opaque)))
        entry, step, meets = self.decoder.span(positions, directions)
        middle = entry[:, None] + (torch.arange(self.decoder.places).to(entry) + 0.5) * step[:, None]
        at = (positions[:, None] + middle[..., None] * directions[:, None]).flatten(0, 1)
        along = directions.repeat_interleave(self.decoder.places, dim=0)
        answers = self.decoder.answers(views, torch.zeros_like(at[:, 0]).long(), at, along)
        seen = cameras.project(at[None] * line_field.BENCHMARK_FROM_FIELD, *cameras.extrinsics(*camera.unbind(-1)))
        pixels = torch.stack(seen, dim=-1)[None] / cameras.CENTRE_PX - 1
        shown = functional.grid_sample(opaque[None], pixels, mode="nearest", align_corners=False)[0, 0, 0] > 0
        may = shown.view(-1, self.decoder.places) & meets[:, None] & (middle + 0.5 * step[:, None] > 0)
        logits, places = answers.view(-1, self.decoder.places, 2).unbind(-1)
        hits = middle + (torch.where(may, places, 0.5) - 0.5) * step[:, None]
        return line_field.Parts(hits[None], torch.where(may, logits, line_field.EMPTY)[None], entry[None], step[None])


_TETRAHEDRON = ((1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0))
_ROUNDING, _STEADY, _APART = 3e-7, 5e-5, 1e-3  # of positions; of outputs; of the two largest log w
_LEAST = -12.0  # log w below which float32 in onnxruntime is too coarse to tell parts apart: such a ray sees nothing


def line_graphs(model: line_field.ImageDDFModel, image_size: int) -> dict[str, Graph]:
    """The graphs of a trained model with image features, by the name of their file."""
    return {"rays": RaysGraph(model, image_size), "encode": ViewsGraph(model, image_size)}


def ddf_graphs(
    model: reconstruction_models.DDFModel, image_size: int, outputs: Sequence[str] | None
) -> dict[str, Graph]:
    """The graphs of a trained DDF model, by the name of their file."""
    return {
        "field": FieldGraph(model.field, outputs, model.decoder.modulator, example_latents(model, image_size)),
        "encoders": EncodersGraph(model, image_size),
    }


@torch.no_grad()
def example_latents(model: reconstruction_models.ReconstructionModel, image_size: int) -> Float[Tensor, "k z"]:
    """Latents of three images, in the range that the decoder was trained for."""
    return model.shape_encoder(example_images(3, image_size, torch.Generator().manual_seed(0)))


def example_images(count: int, size: int, generator: torch.Generator) -> Float[Tensor, "n 4 size size"]:
    """Coloured noise on an ellipse, transparent round it."""
    axis = torch.linspace(-1, 1, size)
    half = 0.3 + 0.6 * torch.rand((count, 2, 1, 1), generator=generator)
    inside = (axis[:, None] / half[:, 0]).square() + (axis / half[:, 1]).square() <= 1
    colours = torch.rand((count, 3, size, size), generator=generator)
    alpha = inside.to(colours.dtype)[:, None]
    return torch.cat((colours * alpha, alpha), dim=1)

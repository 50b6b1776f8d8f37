"""What is exported: torch modules with named inputs and outputs, around the networks of `fields` and `models`.

A graph computes what the package itself computes, by the same functions; `onnx_export` turns it into a file and
`onnx_parity` compares the two. Letters: n oriented points or images, the one free axis; k examples; z latent; s image
side.
"""

import types
from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import field_outputs, pddf, siren
from ddf.fields.field_outputs import OUTPUTS
from ddf.fields.field_values import FieldValues
from ddf.models import reconstruction_models
from ddf.models.encoders import IMAGE_CHANNELS

DYNAMIC = "n"  # the name of the axis whose length is free


class Graph(nn.Module):
    """What every graph declares.

    what: one sentence for the file. inputs: name to shape, the free axis called `n`. meanings: of the outputs, in
    order. tolerances: of the outputs. relative: outputs whose differences are divided by max(1, |value|).
    largest_batch: of a check; None for any. examples: of inputs that an encoder gives, for the check, k of each.
    """

    what: str
    inputs: dict[str, tuple[int | str, ...]]
    meanings: dict[str, str]
    tolerances: dict[str, float]
    largest_batch: int | None = None
    relative: frozenset[str] = frozenset()
    examples: Mapping[str, Tensor] = types.MappingProxyType({})

    def values(self, inputs: Mapping[str, Tensor]) -> FieldValues | None:
        """The field at the inputs, where the graph holds one."""
        return None


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

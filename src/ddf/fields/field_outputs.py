"""The named outputs of a field that a file can hold, each with its tolerance and the points where it is continuous.

Everything is made of plain operators (`derivatives` has explicit passes), so one graph without autograd holds it all.
Positions and directions are in the field frame, whose box is [-1, 1]^3; depth is in its units, along the ray.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.core import checks
from ddf.fields import curvature, derivatives, pddf

SWITCH_LOGIT = 1e-4  # |logit w_1| below which rounding may choose the other component
GRAZING_COSINE = 1e-3  # |n·v| below which rounding may turn the normal round
VANISHING_GRADIENT = 1e-3  # ‖∇_p d‖ over the largest of the batch, below which its direction is rounding


class FieldValues:
    """One field at oriented points: every quantity is computed when it is first asked for, and once."""

    def __init__(
        self,
        field: pddf.PDDF,
        positions: Float[Tensor, "n 3"],
        directions: Float[Tensor, "n 3"],
        modulations: Sequence[Float[Tensor, "1 _"]] | None,
    ) -> None:
        self.field, self.positions, self.directions, self.modulations = field, positions, directions, modulations

    @cached_property
    def trace(self) -> derivatives.Trace:
        """The forward pass with the slopes that derivative passes read."""
        inputs = self.field.inputs(self.positions, self.directions)
        return derivatives.trace(self.field.network, inputs, self.modulations)

    @property
    def raw(self) -> Float[Tensor, "n 4"]:
        """The network's outputs before any activation."""
        return self.trace.outputs

    @cached_property
    def raw_depth_gradient(self) -> Float[Tensor, "n 3"]:
        """∇_p of the raw depth of the heavier component, by the adjoint pass."""
        return derivatives.adjoint(self.field.network, self.trace.slopes, pddf.heavier_rows(self.raw))

    @property
    def normals(self) -> Float[Tensor, "n 3"]:
        """Unit, facing back."""
        return derivatives.normals(self.raw_depth_gradient, self.directions)

    def curvature(self, name: str) -> Float[Tensor, "n"]:
        """One of `curvature.OUTPUTS`, by its own passes; onnxruntime merges what two of them have in common."""
        surface = curvature.surface(self.field, self.positions, self.directions, self.modulations, (name,))
        values = surface.mean if name == "mean_curvature" else surface.gaussian
        if values is None:
            raise ValueError(f"no curvature is called {name!r}")
        return values

    @property
    def weights(self) -> Float[Tensor, "n 2"]:
        """w_1 and w_2 = 1 - w_1."""
        first = torch.sigmoid(self.raw[..., pddf.WEIGHT_ROW])
        return torch.stack((first, 1 - first), dim=-1)

    def everywhere(self) -> Bool[Tensor, "n"]:
        """All points."""
        return torch.ones_like(self.raw[..., 0], dtype=torch.bool)

    def component_is_clear(self) -> Bool[Tensor, "n"]:
        """Points where the heavier component is not a matter of rounding: the depth jumps where it changes."""
        return self.raw[..., pddf.WEIGHT_ROW].abs() >= SWITCH_LOGIT

    def normal_is_clear(self) -> Bool[Tensor, "n"]:
        """Points where, besides, neither the side nor the direction of the normal is a matter of rounding."""
        length = self.raw_depth_gradient.norm(dim=-1)
        towards = (self.normals * self.directions).sum(-1).abs()
        steep = length > VANISHING_GRADIENT * length.amax()
        return self.component_is_clear() & (towards >= GRAZING_COSINE) & steep


@dataclass(frozen=True)
class Output:
    """One named output of a field.

    compute: its values, first axis the points. tolerance: largest difference between two correct float32 programs.
    clear: the points where the output is continuous, so that the tolerance can hold. meaning: for the file. relative:
    differences are divided by max(1, |value|), for outputs without a bound.
    """

    compute: Callable[[FieldValues], Tensor]
    tolerance: float
    clear: Callable[[FieldValues], Tensor]
    meaning: str
    relative: bool = False


# A new output is one entry here.
OUTPUTS: dict[str, Output] = {
    "visibility": Output(
        lambda values: pddf.visibility(values.raw), 1e-5, FieldValues.everywhere, "ξ in [0, 1]: does the ray hit"
    ),
    "depth": Output(
        lambda values: values.field.depth(values.raw),
        1e-5,
        FieldValues.component_is_clear,
        "distance along the ray to its first hit, field units; meaningless where nothing is visible",
    ),
    "normals": Output(
        lambda values: values.normals,
        8.7e-4,  # the chord of 0.05 degrees
        FieldValues.normal_is_clear,
        "unit normal at the hit, facing back (n·v <= 0); meaningless where nothing is visible",
    ),
    "weights": Output(lambda values: values.weights, 1e-5, FieldValues.everywhere, "w_1, w_2 of the two components"),
    "mean_curvature": Output(
        lambda values: values.curvature("mean_curvature"),
        2e-3,  # second derivatives cancel, and a tangent basis turns with the normal
        FieldValues.normal_is_clear,
        "tr(II), no factor 1/2, in 1/field units; -2/r on a sphere seen from outside; meaningless where unseen",
        relative=True,
    ),
    "gaussian_curvature": Output(
        lambda values: values.curvature("gaussian_curvature"),
        2e-3,
        FieldValues.normal_is_clear,
        "det(II) in 1/(field units)^2; 1/r^2 on a sphere; meaningless where nothing is visible",
        relative=True,
    ),
}


def require_outputs(outputs: Sequence[str]) -> tuple[str, ...]:
    """The outputs as a tuple.

    Raises:
      InputError: none, one twice, or one that does not exist.
    """
    unknown = [name for name in outputs if name not in OUTPUTS]
    if unknown or not outputs or len(set(outputs)) < len(outputs):
        raise checks.InputError(
            f"outputs must be one or more of {', '.join(OUTPUTS)}; got {', '.join(outputs) or 'none'}"
        )
    return tuple(outputs)

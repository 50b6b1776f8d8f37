"""What one network says at oriented points: every quantity computed when it is first asked for, and once.

Everything is made of plain operators (`derivatives` has explicit passes), so one graph without autograd holds it all.
"""

from collections.abc import Collection, Sequence
from functools import cached_property

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from ddf.fields import derivatives, field_outputs, pddf

SWITCH_LOGIT = 1e-4  # difference of the logits of two weights below which rounding may choose the other component
GRAZING_COSINE = 1e-3  # |n·v| below which rounding may turn the normal round
VANISHING_GRADIENT = 1e-3  # ‖∇_p d‖ over the largest of the batch, below which its direction is rounding


class FieldValues:
    """One field at oriented points, field frame and unit; meaningless where nothing is visible.

    asked: the outputs that will be read, whose passes are then shared and no longer than they need be.
    """

    def __init__(
        self,
        field: pddf.PDDF,
        positions: Float[Tensor, "n 3"],
        directions: Float[Tensor, "n 3"],
        modulations: Sequence[Float[Tensor, "1 _"]] | None = None,
        asked: Collection[str] = ("normals",),
    ) -> None:
        self.field, self.positions, self.directions, self.modulations = field, positions, directions, modulations
        read = {field_outputs.OUTPUTS[name].reads for name in asked}
        self.reads = max(read, key=field_outputs.READS.index, default="values")

    @cached_property
    def trace(self) -> derivatives.Trace:
        """The forward pass with the slopes that derivative passes read."""
        inputs = self.field.inputs(self.positions, self.directions)
        return derivatives.trace(self.field.network, inputs, self.modulations)

    @cached_property
    def surface(self) -> derivatives.Surface:
        """The passes of curvature."""
        return derivatives.Surface(self.field, self.positions, self.directions, self.modulations)

    @cached_property
    def raw(self) -> Float[Tensor, "n out"]:
        """The network's outputs before any activation."""
        if self.reads == "values":
            return self.field(self.positions, self.directions, self.modulations)
        return self.surface.raw if self.reads == "curvature" else self.trace.outputs

    @property
    def visibility(self) -> Float[Tensor, "n"]:
        """ξ in [0, 1]."""
        return pddf.visibility(self.raw)

    @property
    def depth(self) -> Float[Tensor, "n"]:
        """Of the heaviest component."""
        return self.field.depth(self.raw)

    @cached_property
    def raw_depth_gradient(self) -> Float[Tensor, "n 3"]:
        """∇_p of the raw depth of the heaviest component, by the adjoint pass."""
        if self.reads == "curvature":
            return self.surface.gradient
        return derivatives.adjoint(self.field.network, self.trace.slopes, pddf.heavier_rows(self.raw))

    @cached_property
    def normals(self) -> Float[Tensor, "n 3"]:
        """Unit, facing back."""
        return derivatives.normals(self.raw_depth_gradient, self.directions)

    @property
    def weights(self) -> Float[Tensor, "n k"]:
        """w_i, of sum 1."""
        return pddf.weights(self.raw)

    def component_gradient(self, index: int) -> Float[Tensor, "n 3"]:
        """∇_p of the raw depth of one component."""
        slopes = self.surface.slopes if self.reads == "curvature" else self.trace.slopes
        depths = self.raw[..., : pddf.NUM_COMPONENTS]
        row = torch.eye(depths.shape[-1]).to(depths)[index]
        return derivatives.adjoint(self.field.network, slopes, row.expand_as(depths))

    def component_normals(self, index: int) -> Float[Tensor, "n 3"]:
        """n_i = ±∇_p d_i/‖∇_p d_i‖, unit, facing back."""
        return derivatives.normals(self.component_gradient(index), self.directions)

    @property
    def everywhere(self) -> Bool[Tensor, "n"]:
        """All points."""
        return torch.ones_like(self.raw[..., 0], dtype=torch.bool)

    @property
    def component_is_clear(self) -> Bool[Tensor, "n"]:
        """Points where the heaviest component is not a matter of rounding: the depth jumps where it changes."""
        return self.raw[..., pddf.WEIGHT_ROW].abs() >= SWITCH_LOGIT

    @property
    def normal_is_clear(self) -> Bool[Tensor, "n"]:
        """Points where, besides, neither the side nor the direction of the normal is a matter of rounding."""
        return self.component_is_clear & self._steep(self.raw_depth_gradient)

    def component_normal_is_clear(self, index: int) -> Bool[Tensor, "n"]:
        """The same of the normal of one component."""
        return self._steep(self.component_gradient(index))

    def _steep(self, gradient: Float[Tensor, "n 3"]) -> Bool[Tensor, "n"]:
        length = gradient.norm(dim=-1)
        towards = (derivatives.normals(gradient, self.directions) * self.directions).sum(-1).abs()
        return (towards >= GRAZING_COSINE) & (length > VANISHING_GRADIENT * length.amax())


def evaluate(
    field: pddf.PDDF,
    positions: Float[Tensor, "n 3"],
    directions: Float[Tensor, "n 3"],
    asked: Collection[str],
    modulations: Sequence[Float[Tensor, "1 _"]] | None = None,
) -> dict[str, Tensor]:
    """Named outputs in the field frame, what the field says there whether or not it says that anything is visible."""
    names = field_outputs.require(asked)
    values = FieldValues(field, positions, directions, modulations, names)
    return {name: field_outputs.OUTPUTS[name].compute(values) for name in names}

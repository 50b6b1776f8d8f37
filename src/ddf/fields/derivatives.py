"""Explicit derivative passes through a sine network: nothing that a loss does not read is built.

With a_l, h_l, m_l, ω_l as in `siren` and the slope c_l = m_l ω_l cos(ω_l a_l):

  tangent   ȧ_l = W_l (c_{l-1} * ȧ_{l-1}), from a direction in input space; of *all* outputs for about one forward pass
  adjoint   g_{l-1} = (g_l * c_l) W_l, from a row of the head; the gradient of *one* output for about one forward pass

Both are plain operators, so their own gradient in the parameters is ordinary first-order autograd, and they export to
ONNX; `passes` has them once more for training, with that gradient written out. ∂/∂p is formed (the first three
inputs); derived here, see also [DDF22] §3.1 for what reads it.

Curvature needs second derivatives in p. Every second derivative of a sine network comes from its activations:
∂²h_l/∂a_l² = -ω_l² h_l, and everything between two activations is linear. So for one output y, its adjoint states
g_l = ∂y/∂h_l and two tangents ȧ_l, ȧ'_l of the pre-activations give (derived here)

  t'^T H_p[y] t = -Σ_l ω_l² Σ_k g_lk h_lk ȧ_lk ȧ'_lk.

One forward pass, one adjoint pass and two tangents give normals and both curvatures; no entry of H is formed that
nothing reads, no graph is kept, and all of it exports to ONNX.

Depth is d = φ(y) (`siren.ACTIVATIONS`): H[d] = φ' H[y] + φ'' ∇y ∇y^T. Along tangents of the surface, which are normal
to ∇y, the term of φ'' vanishes whatever it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import siren
from ddf.fields.pddf import PDDF, heavier_rows

POSITION = slice(0, 3)  # the inputs are (p, v): derivatives are taken in p


@dataclass(frozen=True)
class Trace:
    """What one forward pass leaves for the derivative passes.

    outputs: y, of all n points. slopes: c_l = ∂h_l/∂a_l per layer. bends: ∂²h_l/∂a_l² per layer; none unless asked for.
    """

    outputs: Float[Tensor, "*shapes n out"]
    slopes: list[Float[Tensor, "*shapes n _"]]
    bends: list[Float[Tensor, "*shapes n _"]]


def trace(
    network: siren.SineNetwork,
    inputs: Float[Tensor, "*shapes n in"],
    modulations: Sequence[Tensor] | None = None,
    bent: bool = False,
) -> Trace:
    """Forward pass that keeps the slopes and, for second derivatives, the bends."""
    hidden, slopes, bends = inputs, [], []
    for index, layer in enumerate(network.layers):
        omega = network.omegas[index]
        angles = siren.scaled_linear(hidden, layer, omega)
        hidden, slope = torch.sin(angles), torch.cos(angles)
        scale = None if modulations is None else modulations[index]
        if scale is not None:
            hidden = hidden * scale
            slope = slope * (scale if omega == 1.0 else omega * scale)
        elif omega != 1.0:
            slope = slope * omega
        slopes.append(slope)
        if bent:
            bends.append(-(omega**2) * hidden)
    return Trace(network.head(hidden), slopes, bends)


def adjoint(
    network: siren.SineNetwork,
    slopes: Sequence[Float[Tensor, "*shapes n _"]],
    cotangents: Float[Tensor, "*shapes n out"],
) -> Float[Tensor, "*shapes n 3"]:
    """∇_p (g · y), g = `cotangents` over the first outputs: one-hot rows pick one output per point."""
    gradient = cotangents @ network.head.weight[: cotangents.shape[-1]]
    for layer, slope in zip(reversed(network.layers[1:]), reversed(slopes[1:]), strict=True):
        gradient = (gradient * slope) @ layer.weight
    return (gradient * slopes[0]) @ network.layers[0].weight[:, POSITION]


def normals(
    depth_grad_p: Float[Tensor, "*batch 3"], directions: Float[Tensor, "*batch 3"]
) -> Float[Tensor, "*batch 3"]:
    """n = ±∇_p d/‖∇_p d‖ with n·v <= 0. Source: [DDF22] §3.1, Property II.

    Args:
      depth_grad_p: ∇_p d up to any positive factor; a zero vector gives the zero vector.
      directions: v, unit.
    """
    unit = nn.functional.normalize(depth_grad_p, dim=-1, eps=1e-12)  # exact zeros stay zero and finite in the gradient
    facing = (unit * directions).sum(-1, keepdim=True) > 0
    return torch.where(facing, -unit, unit)


def adjoint_states(
    network: siren.SineNetwork,
    slopes: Sequence[Float[Tensor, "*shapes n _"]],
    cotangents: Float[Tensor, "*shapes n out"],
) -> tuple[list[Float[Tensor, "*shapes n _"]], Float[Tensor, "*shapes n 3"]]:
    """g_l = ∂(g · y)/∂h_l of every layer, first layer first, and the gradient ∇_p (g · y) that they end in.

    `adjoint` has a loop of its own, because holding the states slows it down by a quarter and more.
    """
    states = [cotangents @ network.head.weight[: cotangents.shape[-1]]]
    for layer, slope in zip(reversed(network.layers[1:]), reversed(slopes[1:]), strict=True):
        states.append((states[-1] * slope) @ layer.weight)
    gradient = (states[-1] * slopes[0]) @ network.layers[0].weight[:, POSITION]
    return states[::-1], gradient


def tangent_states(
    network: siren.SineNetwork, slopes: Sequence[Float[Tensor, "*shapes n _"]], directions: Float[Tensor, "*shapes n 3"]
) -> list[Float[Tensor, "*shapes n _"]]:
    """ȧ_l = ∂a_l/∂p · t of every layer, first layer first."""
    states = [directions @ network.layers[0].weight[:, POSITION].T]
    for layer, slope in zip(network.layers[1:], slopes[:-1], strict=True):
        states.append(nn.functional.linear(states[-1] * slope, layer.weight))
    return states


def hessian_form(
    bends: Sequence[Float[Tensor, "*shapes n _"]],
    adjoints: Sequence[Float[Tensor, "*shapes n _"]],
    first: Sequence[Float[Tensor, "*shapes n _"]],
    second: Sequence[Float[Tensor, "*shapes n _"]],
) -> Float[Tensor, "*shapes n"]:
    """t'^T H_p[g · y] t from the adjoint states of g · y and the tangent states of t and t' (module docstring)."""
    terms = [(g * bend * one * two).sum(-1) for g, bend, one, two in zip(adjoints, bends, first, second, strict=True)]
    return torch.stack(terms).sum(0)


def tangent_basis(normals: Float[Tensor, "*n 3"]) -> tuple[Float[Tensor, "*n 3"], Float[Tensor, "*n 3"]]:
    """t_1, t_2, orthonormal and normal to n; finite for a zero vector too. Source: Duff et al. 2017."""
    x, y, z = normals.unbind(-1)
    sign = torch.where(z >= 0, torch.ones_like(z), -torch.ones_like(z))
    a = -1.0 / (sign + z)
    b = x * y * a
    first = torch.stack((1 + sign * x * x * a, sign * b, -sign * x), dim=-1)
    second = torch.stack((b, sign + y * y * a, -y), dim=-1)
    return first, second


class Surface:
    """The surface that a field sees along each ray, field frame and units; meaningless where nothing is visible.

    From II_ij = (t_j^T H_p[d] t_i) n^T v, g = I. Source: [DDF22] §3.1, Property V. With respect to the normal that
    faces the viewer: a sphere of radius r has mean curvature -2/r seen from outside, +2/r from inside, and Gaussian
    curvature 1/r² (the convention of `primitives`). Only what is read is computed: the mean alone needs no mixed form.

    raw: the network's outputs. slopes: as of `Trace`. gradient: ∇_p of the raw d_{i*}. normals: unit,
    facing back.
    """

    def __init__(
        self,
        field: PDDF,
        positions: Float[Tensor, "*shapes n 3"],
        directions: Float[Tensor, "*shapes n 3"],
        modulations: Sequence[Tensor] | None = None,
    ) -> None:
        found = trace(field.network, field.inputs(positions, directions), modulations, bent=True)
        rows = heavier_rows(found.outputs)
        self.raw, self.slopes, self._bends = found.outputs, found.slopes, found.bends
        self._adjoints, self.gradient = adjoint_states(field.network, found.slopes, rows)
        self.normals = normals(self.gradient, directions)
        self._network = field.network
        slope = (rows * field.depth_slopes(found.outputs)).sum(-1)  # φ'' meets ∇y · t_i = 0
        self._factor = slope * (self.normals * directions).sum(-1)

    @cached_property
    def _tangents(self) -> list[list[Float[Tensor, "*shapes n _"]]]:
        return [tangent_states(self._network, self.slopes, t) for t in tangent_basis(self.normals)]

    def _form(self, one: int, two: int) -> Float[Tensor, "*shapes n"]:
        return self._factor * hessian_form(self._bends, self._adjoints, self._tangents[one], self._tangents[two])

    @cached_property
    def _own(self) -> tuple[Float[Tensor, "*shapes n"], Float[Tensor, "*shapes n"]]:
        return self._form(0, 0), self._form(1, 1)

    @cached_property
    def mean(self) -> Float[Tensor, "*shapes n"]:
        """tr(II), without a factor 1/2, as printed there."""
        return self._own[0] + self._own[1]

    @cached_property
    def gaussian(self) -> Float[Tensor, "*shapes n"]:
        """det(II)."""
        return self._own[0] * self._own[1] - self._form(0, 1).square()

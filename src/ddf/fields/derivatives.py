"""Explicit derivative passes through a sine network: nothing that a loss does not read is built.

With a_l, h_l, m_l, ω_l as in `siren` and the slope c_l = m_l ω_l cos(ω_l a_l):

  tangent   t_l = c_l * (W_l t_{l-1}), from a direction in input space; J t of *all* outputs for about one forward pass
  adjoint   g_{l-1} = (g_l * c_l) W_l, from a row of the head; the gradient of *one* output for about one forward pass

Both are plain operators, so their own gradient in the parameters is ordinary first-order autograd, and they export to
ONNX; `passes` has them once more for training, with that gradient written out. ∂/∂p is formed (the first three
inputs), and ∂/∂v where a loss reads it; derived here, see also [DDF22] §3.1 for what reads it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.fields import siren

POSITION = slice(0, 3)  # the inputs are (p, v): derivatives are taken in p


@dataclass(frozen=True)
class Trace:
    """What one forward pass leaves for the derivative passes.

    outputs: y, of all n points.
    slopes: per layer c_l.
    """

    outputs: Float[Tensor, "*shapes n out"]
    slopes: list[Float[Tensor, "*shapes n _"]]


def trace(
    network: siren.SineNetwork,
    inputs: Float[Tensor, "*shapes n in"],
    modulations: Sequence[Tensor] | None = None,
) -> Trace:
    """Forward pass that keeps the slopes."""
    hidden, slopes = inputs, []
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
    return Trace(network.head(hidden), slopes)


def tangent(
    network: siren.SineNetwork,
    slopes: Sequence[Float[Tensor, "*shapes n _"]],
    directions: Float[Tensor, "*shapes n 3"],
    rows: slice = slice(None),
) -> Float[Tensor, "*shapes n rows"]:
    """∇_p y · t for the chosen rows of the head, all at once.

    Args:
      directions: t, any length, one per point of the slopes.
    """
    vectors = directions @ network.layers[0].weight[:, POSITION].T
    for layer, slope in zip(network.layers[1:], slopes[:-1], strict=True):
        vectors = nn.functional.linear(vectors * slope, layer.weight)
    return nn.functional.linear(vectors * slopes[-1], network.head.weight[rows])


def adjoint(
    network: siren.SineNetwork,
    slopes: Sequence[Float[Tensor, "*shapes n _"]],
    cotangents: Float[Tensor, "*shapes n out"],
) -> Float[Tensor, "*shapes n 3"]:
    """∇_p (g · y), g = `cotangents` over the first outputs: one-hot rows pick one output per point.

    Args:
      cotangents: over the head's first rows, as many as its last axis has.
    """
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

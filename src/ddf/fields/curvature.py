"""Curvature of a field's surface: second derivatives in p through a sine network, by plain operators only.

With a_l, h_l, c_l, ω_l as in `derivatives`, every second derivative of a sine network comes from its activations:
∂²h_l/∂a_l² = -ω_l² h_l, and everything between two activations is linear. So for one output y, its adjoint states
g_l = ∂y/∂h_l and two tangents ȧ_l, ȧ'_l of the pre-activations give (derived here)

  t'^T H_p[y] t = -Σ_l ω_l² Σ_k g_lk h_lk ȧ_lk ȧ'_lk.

One forward pass, one adjoint pass and two tangents give normals and both curvatures; no entry of H is formed that
nothing reads, no graph is kept, and all of it exports to ONNX.

Depth is d = φ(y) (`activations`): H[d] = φ' H[y] + φ'' ∇y ∇y^T. Along tangents of the surface, which are normal to ∇y,
the term of φ'' vanishes whatever it is.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from ddf.core import checks
from ddf.fields import derivatives, siren
from ddf.fields.pddf import NUM_COMPONENTS, PDDF, heavier_rows

OUTPUTS = ("mean_curvature", "gaussian_curvature")


@dataclass(frozen=True)
class SecondTrace:
    """What one forward pass leaves for second derivatives.

    outputs: y. slopes: c_l = ∂h_l/∂a_l per layer. bends: ∂²h_l/∂a_l² per layer.
    """

    outputs: Float[Tensor, "*shapes n out"]
    slopes: list[Float[Tensor, "*shapes n _"]]
    bends: list[Float[Tensor, "*shapes n _"]]


@dataclass(frozen=True)
class Surface:
    """The surface that a field sees along each ray, field frame and units; meaningless where nothing is visible.

    raw: the network's outputs. normals: unit, facing back. mean, gaussian: None where not asked for.
    """

    raw: Float[Tensor, "*shapes n 4"]
    normals: Float[Tensor, "*shapes n 3"]
    mean: Float[Tensor, "*shapes n"] | None
    gaussian: Float[Tensor, "*shapes n"] | None


def trace(
    network: siren.SineNetwork, inputs: Float[Tensor, "*shapes n in"], modulations: Sequence[Tensor] | None = None
) -> SecondTrace:
    """Forward pass that keeps slopes and bends of every layer."""
    hidden, slopes, bends = inputs, [], []
    for index, layer in enumerate(network.layers):
        omega = network.omegas[index]
        angles = siren.scaled_linear(hidden, layer, omega)
        hidden, slope = torch.sin(angles), omega * torch.cos(angles)
        if modulations is not None:
            hidden, slope = hidden * modulations[index], slope * modulations[index]
        slopes.append(slope)
        bends.append(-(omega**2) * hidden)
    return SecondTrace(network.head(hidden), slopes, bends)


def adjoint_states(
    network: siren.SineNetwork,
    slopes: Sequence[Float[Tensor, "*shapes n _"]],
    cotangents: Float[Tensor, "*shapes n out"],
) -> tuple[list[Float[Tensor, "*shapes n _"]], Float[Tensor, "*shapes n 3"]]:
    """g_l = ∂(g · y)/∂h_l of every layer, first layer first, and the gradient ∇_p (g · y) that they end in.

    `derivatives.adjoint` has a loop of its own, because holding the states slows it down by a quarter and more.

    Args:
      cotangents: g, over the head's first rows, as in `derivatives.adjoint`.
    """
    states = [cotangents @ network.head.weight[: cotangents.shape[-1]]]
    for layer, slope in zip(reversed(network.layers[1:]), reversed(slopes[1:]), strict=True):
        states.append((states[-1] * slope) @ layer.weight)
    gradient = (states[-1] * slopes[0]) @ network.layers[0].weight[:, derivatives.POSITION]
    return states[::-1], gradient


def tangent_states(
    network: siren.SineNetwork,
    slopes: Sequence[Float[Tensor, "*shapes n _"]],
    directions: Float[Tensor, "*shapes n 3"],
) -> list[Float[Tensor, "*shapes n _"]]:
    """ȧ_l = ∂a_l/∂p · t of every layer, first layer first."""
    states = [directions @ network.layers[0].weight[:, derivatives.POSITION].T]
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


def depth_bend(field: PDDF, raw_depth: Float[Tensor, "*n"]) -> Float[Tensor, "*n"]:
    """φ'' of the depth activation d = φ(y); `PDDF.depth_slopes` has φ'."""
    return field.activation.bend(raw_depth, field.config.depth_sharpness)


def depth_hessian_form(
    field: PDDF,
    positions: Float[Tensor, "*shapes n 3"],
    directions: Float[Tensor, "*shapes n 3"],
    first: Float[Tensor, "*shapes n 3"],
    second: Float[Tensor, "*shapes n 3"],
    modulations: Sequence[Tensor] | None = None,
) -> Float[Tensor, "*shapes n"]:
    """t'^T H_p[d_{i*}] t, the depth activation included, for any t = `first` and t' = `second`, in 1 / field units."""
    found = trace(field.network, field.inputs(positions, directions), modulations)
    rows = heavier_rows(found.outputs)
    adjoints, gradient = adjoint_states(field.network, found.slopes, rows)
    one = tangent_states(field.network, found.slopes, first)
    two = tangent_states(field.network, found.slopes, second)
    form = hessian_form(found.bends, adjoints, one, two)
    slope = (rows * field.depth_slopes(found.outputs)).sum(-1)
    bend = depth_bend(field, (rows * found.outputs[..., :NUM_COMPONENTS]).sum(-1))
    return slope * form + bend * (gradient * first).sum(-1) * (gradient * second).sum(-1)


def tangent_basis(normals: Float[Tensor, "*n 3"]) -> tuple[Float[Tensor, "*n 3"], Float[Tensor, "*n 3"]]:
    """t_1, t_2, orthonormal and normal to n; finite for a zero vector too. Source: Duff et al. 2017."""
    x, y, z = normals.unbind(-1)
    sign = torch.where(z >= 0, torch.ones_like(z), -torch.ones_like(z))
    a = -1.0 / (sign + z)
    b = x * y * a
    first = torch.stack((1 + sign * x * x * a, sign * b, -sign * x), dim=-1)
    second = torch.stack((b, sign + y * y * a, -y), dim=-1)
    return first, second


def surface(
    field: PDDF,
    positions: Float[Tensor, "*shapes n 3"],
    directions: Float[Tensor, "*shapes n 3"],
    modulations: Sequence[Tensor] | None = None,
    outputs: Collection[str] = OUTPUTS,
) -> Surface:
    """Normals and curvatures of the surface that d_{i*} sees, from II_ij = (t_j^T H_p[d] t_i) n^T v, g = I.

    Source: [DDF22] §3.1, Property V. Mean curvature is tr(II), without a factor 1/2, as printed there; Gaussian
    curvature is det(II). With respect to the normal that faces the viewer: a sphere of radius r has mean curvature -2/r
    seen from outside, +2/r from inside, and Gaussian curvature 1/r² (the convention of `primitives`). Only what is
    asked for is computed: the mean alone needs no mixed form.

    Args:
      outputs: some of `OUTPUTS`.
    Raises:
      InputError: an output that does not exist.
    """
    unknown = sorted(set(outputs) - set(OUTPUTS))
    if unknown:
        raise checks.InputError(f"outputs must be among {', '.join(OUTPUTS)}; got {', '.join(unknown)}")
    found = trace(field.network, field.inputs(positions, directions), modulations)
    rows = heavier_rows(found.outputs)
    adjoints, gradient = adjoint_states(field.network, found.slopes, rows)
    normals = derivatives.normals(gradient, directions)
    if not outputs:
        return Surface(found.outputs, normals, None, None)
    first, second = (tangent_states(field.network, found.slopes, t) for t in tangent_basis(normals))
    slope = (rows * field.depth_slopes(found.outputs)).sum(-1)  # φ'' meets ∇y · t_i = 0
    factor = slope * (normals * directions).sum(-1)
    form_11 = factor * hessian_form(found.bends, adjoints, first, first)
    form_22 = factor * hessian_form(found.bends, adjoints, second, second)
    mean = form_11 + form_22 if "mean_curvature" in outputs else None
    if "gaussian_curvature" not in outputs:
        return Surface(found.outputs, normals, mean, None)
    form_12 = factor * hessian_form(found.bends, adjoints, first, second)
    return Surface(found.outputs, normals, mean, form_11 * form_22 - form_12.square())

"""The shape-fitting loss: one function per term, one table of what applies where. Source: [DDF22] §3.4, app. C and E.

A batch holds, for every shape, its samples in the order of `sample_types`, so that what each term reads is one slice:
the directed eikonal E U A B, normals U A B, the transition S T, supervision U A B S T O; nothing reads a derivative on
O. After these may come samples that are supervised alone, of the same types or proposed by the field: a point without
derivatives costs less than half, and depth is what a small budget should buy first. Every term is the
mean over the oriented points that it applies to (the paper does not say; derived here).
"""

import functools
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.core import schema
from ddf.core.schema import fixed, setting
from ddf.data.samples import sample_batch
from ddf.data.samples import sample_types as types
from ddf.fields import derivatives, passes
from ddf.fields.pddf import NUM_COMPONENTS, PDDF, VISIBILITY_ROW, WEIGHT_ROW, heavier_rows

LEAST_SHARE = 0.05  # of a component in what it learns by, however small its weight

BLOCK_VALUES = {"cpu": 2**19, "cuda": 2**25}  # values of a block: what stays in a CPU's cache, fills a GPU
BLOCK_POINTS = 1400  # of a block of 𝔏_S, for each thread of a CPU, whatever the width; by trial


def block_values(device: torch.device) -> int:
    """How many values, such as points times the widest layer, are worked on at a time."""
    return BLOCK_VALUES.get(device.type, BLOCK_VALUES["cuda"])


@dataclass(frozen=True, kw_only=True)
class LossWeights(schema.Checked):
    """γ of every term, by default those of [DDF22] app. E, and ε_T, the transition speed that L_T asks for.

    depth_of: `chosen` is the paper's |d_{i*} - d|, which gives the weights w_i no gradient; `mixture`, Σ w_i |d_i - d|,
    also moves weight to the better component; `gated` does so where the weights are all but 0 and 1 too, see
    `gated_depth_error` (both derived here).
    """

    depth: float = setting(5.0, "γ_d of the depth loss, doubled on A, U and P", "app. si3dr", least=0)
    depth_of: Literal["chosen", "mixture", "gated"] = setting("chosen", "component that the depth loss is of", "§3.4")
    depth_huber: float | None = setting(
        None,
        "depth error beyond which its loss is linear, so that occlusion edges do not outweigh all; null: squared",
        "§3.4",
        above=0,
    )
    visibility: float = setting(10.0, "γ_ξ of the visibility loss", "app. si3dr", least=0)
    normals: float = setting(
        10.0, "γ_n of the normal loss; less lets their sign settle after the depth", "app. si3dr", least=0
    )
    weight_variance: float = setting(1.0, "γ_V of the weights' variance", "app. si3dr", least=0)
    eikonal_depth: float = setting(0.1, "γ_E,d of the directed eikonal loss", "app. si3dr", least=0)
    eikonal_visibility: float = fixed(0.25, least=0)
    transition: float = setting(0.1, "γ_T of the transition loss", "app. si3dr", least=0)
    visibility_variance: float = fixed(0.25, least=0)
    transition_speed: float = fixed(1.0, least=0)


def depth_error(
    depth: Float[Tensor, "*n"], truth: Float[Tensor, "*n"], huber: float | None = None
) -> Float[Tensor, "*n"]:
    """|d_i - d|², the paper's error of a depth.

    With `huber` β > 0 it is e²/(2β) up to e = |d_i - d| = β and e - β/2 beyond (derived here): a ray that passes an
    occlusion edge on the wrong side is off by a whole gap, and the square lets such rays outweigh all others.
    """
    if huber is None:
        return (depth - truth).square()
    return functional.smooth_l1_loss(depth, truth, reduction="none", beta=huber)


def depth_loss(
    field: PDDF,
    raw: Float[Tensor, "*n out"],
    truth: Float[Tensor, "*n"],
    visible: Float[Tensor, "*n"],
    weights: LossWeights,
) -> Float[Tensor, "*n"]:
    """L_d = ξ |d_{i*} - d|², the mixture ξ Σ w_i |d_i - d|², or the gated one. Where ξ = 0 the truth is not read."""
    truth = torch.where(visible > 0, truth, 0.0)  # before it is squared: 0 times the overflow of a large one is NaN
    if weights.depth_of == "chosen":
        return visible * depth_error(field.depth(raw), truth, weights.depth_huber)
    first, second = (depth_error(depth, truth, weights.depth_huber) for depth in field.depths(raw).unbind(-1))
    logit = raw[..., WEIGHT_ROW]
    if weights.depth_of == "gated":
        return visible * gated_depth_error(first, second, logit)
    return visible * torch.lerp(second, first, torch.sigmoid(logit))


def gated_depth_error(
    first: Float[Tensor, "*n"], second: Float[Tensor, "*n"], logit: Float[Tensor, "*n"]
) -> Float[Tensor, "*n"]:
    """Σ w̃_i e_i + |e_1 - e_2| H(w, better), from the errors e_i of two components and w_1's logit (derived here).

    By Σ w_i e_i a weight that has become 1 stays 1: its gradient w_1 w_2 (e_1 - e_2) vanishes, and the other component
    learns nothing there. So here components learn by w̃_i = ε + (1 - 2ε) w_i with ε = `LEAST_SHARE`, taken as numbers,
    and the weight by its cross-entropy H against the better component, whose gradient is |e_1 - e_2| at most, and that
    where the weight is wholly wrong.
    """
    share = LEAST_SHARE + (1 - 2 * LEAST_SHARE) * torch.sigmoid(logit.detach())
    gap = (first - second).detach()
    return torch.lerp(second, first, share) + gap.abs() * functional.softplus(gap.sign() * logit)


def normal_loss(
    normals: Float[Tensor, "*n 3"], truth: Float[Tensor, "*n 3"], visible: Float[Tensor, "*n"]
) -> Float[Tensor, "*n"]:
    """L_n = -ξ |n^T n̂_{i*}|."""
    return -visible * (normals * truth).sum(-1).abs()


def directed_eikonal_loss(
    depth_rates: Float[Tensor, "*n k"],
    visibility_rate: Float[Tensor, "*n"],
    visible: Float[Tensor, "*n"],
    weights: LossWeights,
) -> Float[Tensor, "*n"]:
    """L_DE = γ_Ed Σ_i ξ (∇_p d_i v + 1)² + γ_Eξ (∇_p ξ v)²."""
    depth_term = visible * (depth_rates + 1).square().sum(-1)
    return weights.eikonal_depth * depth_term + weights.eikonal_visibility * visibility_rate.square()


def bernoulli_variance(logits: Float[Tensor, "*n"]) -> Float[Tensor, "*n"]:
    """σ(x)(1 - σ(x)): L_V = Π_i w_i of two weights, and L_Vξ = ξ̂(1 - ξ̂); also the slope of the sigmoid."""
    return torch.sigmoid(logits) * torch.sigmoid(-logits)


def transition_loss(weight_rate: Float[Tensor, "*n"], speed: float) -> Float[Tensor, "*n"]:
    """L_T = max(0, ε_T - |∇_p w_1 n|)²."""
    return torch.relu(speed - weight_rate.abs()).square()


def shape_loss(
    field: PDDF, batch: sample_batch.SampleBatch, modulations: list[Tensor] | None, weights: LossWeights
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """𝔏_S and its unweighted terms (detached).

    Evaluates: the network at all points, the adjoint of d_{i*} on U A B, one tangent on E U A B (along v) and S T
    (along n), nothing more. 𝔏_S is a sum over points, so its gradient is made block by block together with its value
    (`passes`), and what autograd sees of it is one node: differentiable once, in the parameters and modulations.
    """
    inputs = [*(modulations or []), *field.network.parameters()]
    differentiate = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in inputs)
    how = {"weights": weights, "modulated": len(modulations or []), "differentiate": differentiate}
    evaluate = functools.partial(_sums, field, batch, **how)
    total, *terms = _ShapeLoss.apply(evaluate, *inputs)
    return total, dict(zip(TERMS, terms, strict=True))


class _ShapeLoss(torch.autograd.Function):
    """𝔏_S and its terms; the gradient is made in the forward pass and scaled in the backward pass."""

    @staticmethod
    def forward(
        ctx, evaluate: Callable[[Sequence[Tensor]], tuple[Tensor, Sequence[Tensor]]], *inputs: Tensor
    ) -> tuple[Tensor, ...]:
        sums, gradients = evaluate(inputs)
        total, *terms = sums.unbind()
        ctx.mark_non_differentiable(*terms)
        ctx.save_for_backward(*gradients)
        return total, *terms

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, grad_total: Tensor, *_: Tensor) -> tuple[Tensor | None, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        needed = ctx.needs_input_grad[1:]
        scaled = [grad_total * saved if need else None for saved, need in zip(ctx.saved_tensors, needed, strict=True)]
        return None, *scaled


def _sums(
    field: PDDF,
    batch: sample_batch.SampleBatch,
    inputs: Sequence[Tensor],
    *,
    weights: LossWeights,
    modulated: int,
    differentiate: bool,
) -> tuple[Float[Tensor, "terms"], Sequence[Tensor]]:
    """𝔏_S with its terms, and its gradient in the inputs, which are modulations first; block by block."""
    modulations = [modulation.detach() for modulation in inputs[:modulated]]
    parameters = passes.Parameters(field.network)
    found = [torch.zeros_like(modulation) for modulation in modulations]
    sums = torch.zeros(1 + len(TERMS), dtype=parameters.head.dtype, device=parameters.head.device)
    numbers = {term.covers: batch.number(*term.covers) for term in TERMS.values()}
    compiles = differentiate and passes.compiles(sums.device)
    block_loss = functools.partial(passes.compiled_block_loss, _block_loss) if compiles else _block_loss
    for shapes, block in batch.blocks(_block_points(field, batch)):
        part = [modulation[shapes] for modulation in modulations] if modulated else None
        values, gradients = block_loss(field, block, part, weights, parameters, numbers, differentiate)
        sums += values
        for whole, gradient in zip(found, gradients, strict=False):
            whole[shapes] += gradient
    return sums, [*found, *parameters.gradients()] if differentiate else []


def _block_points(field: PDDF, batch: sample_batch.SampleBatch) -> int:
    """Points in a block; a CPU's threads share each product of a block, so more of them take a larger one.

    On a GPU all blocks of a batch have as many shapes as each other, as far as that goes: a pass is compiled for each
    size.
    """
    device = field.network.head.weight.device
    if device.type == "cpu":
        return BLOCK_POINTS * torch.get_num_threads()
    most, (shapes, count) = max(1, block_values(device) // max(field.config.hidden)), batch.visible.shape
    parts = math.ceil(shapes / max(1, most // count))
    return most if most < count else count * math.ceil(shapes / parts)


def _block_loss(
    field: PDDF,
    block: sample_batch.SampleBatch,
    modulations: list[Tensor] | None,
    weights: LossWeights,
    parameters: passes.Parameters,
    numbers: Mapping[types.Span, int],
    differentiate: bool,
) -> tuple[Float[Tensor, "terms"], list[Tensor]]:
    """𝔏_S and its terms of a block, and the gradient in its modulations; `numbers` are those of the whole batch."""
    inputs = field.inputs(block.positions, block.directions)
    eikonal, transition, normals = (block.span(*span) for span in (types.EIKONAL, types.TRANSITION, types.NORMALS))
    along = torch.cat((block.directions[:, eikonal], block.normals[:, transition]), dim=1)
    states = passes.Block(parameters, inputs, along, modulations)
    gradient = states.adjoint(normals, heavier_rows(states.outputs[:, normals]))

    def total(raw: Tensor, rates: Tensor, gradient: Tensor) -> tuple[Tensor, Tensor]:
        logits = raw[:, block.span(*types.GROUND_TRUTH), VISIBILITY_ROW]
        points = Points(field, block, weights, raw, rates, gradient, logits)
        terms = {name: term.summed(points) / numbers[term.covers] for name, term in TERMS.items()}
        shares = [
            terms[name] if term.weight is None else getattr(weights, term.weight) * terms[name]
            for name, term in TERMS.items()
        ]
        whole = functools.reduce(operator.add, shares)
        return whole, torch.stack([whole, *terms.values()]).detach()

    leaves = states.outputs, states.rates, gradient
    if not differentiate:
        return total(*leaves)[1], []
    if torch.compiler.is_compiling():  # its own gradient is not what a compiler reads
        slopes, values = torch.func.grad(total, argnums=(0, 1, 2), has_aux=True)(*leaves)
        return values, states.reverse(*slopes)
    with torch.enable_grad():
        leaves = [each.detach().requires_grad_() for each in leaves]
        whole, values = total(*leaves)
        slopes = torch.autograd.grad(whole, leaves, materialize_grads=True)
    return values, states.reverse(*slopes)


@dataclass(frozen=True)
class Points:
    """What the terms of the loss read of a block.

    raw, rates: outputs and their rates of `passes.Block`. gradient: ∇_p of raw d_{i*} on U A B; raw d_{i*} gives the
    normal: a positive slope does not turn it. logits: of the visibility, where there is ground truth.
    """

    field: PDDF
    block: sample_batch.SampleBatch
    weights: LossWeights
    raw: Float[Tensor, "shapes n out"]
    rates: Float[Tensor, "shapes k out"]
    gradient: Float[Tensor, "shapes m 3"]
    logits: Float[Tensor, "shapes known"]


def _depth_sum(points: Points) -> Tensor:
    block, known = points.block, points.block.span(*types.GROUND_TRUTH)
    visible = block.visible[:, known]
    depth = depth_loss(points.field, points.raw[:, known], block.depth[:, known], visible, points.weights)
    doubled = [block.span(*span) for span in types.DOUBLED_DEPTH]
    again = sum(depth[:, span.start - known.start : span.stop - known.start].sum() for span in doubled)
    return depth.sum() + again


def _visibility_sum(points: Points) -> Tensor:
    visible = points.block.visible[:, points.block.span(*types.GROUND_TRUTH)]
    return functional.binary_cross_entropy_with_logits(points.logits, visible, reduction="sum")


def _visibility_variance_sum(points: Points) -> Tensor:
    return bernoulli_variance(points.logits).sum()


def _normals_sum(points: Points) -> Tensor:
    block, normals = points.block, points.block.span(*types.NORMALS)
    facing = derivatives.normals(points.gradient, block.directions[:, normals])
    return normal_loss(facing, block.normals[:, normals], block.visible[:, normals]).sum()


def _eikonal_sum(points: Points) -> Tensor:
    eikonal = points.block.span(*types.EIKONAL)
    raw, rates = points.raw[:, eikonal], points.rates[:, eikonal]
    visible = _visible(points.block, raw, types.EIKONAL)
    depth_rates = points.field.depth_slopes(raw) * rates[..., :NUM_COMPONENTS]
    visibility_rate = bernoulli_variance(raw[..., VISIBILITY_ROW]) * rates[..., VISIBILITY_ROW]
    return directed_eikonal_loss(depth_rates, visibility_rate, visible, points.weights).sum()


def _weight_variance_sum(points: Points) -> Tensor:
    return bernoulli_variance(points.raw[:, points.block.span(*types.EIKONAL), WEIGHT_ROW]).sum()


def _transition_sum(points: Points) -> Tensor:
    transition = points.block.span(*types.TRANSITION)
    raw, rates = points.raw[:, transition], points.rates[:, transition]
    rate = bernoulli_variance(raw[..., WEIGHT_ROW]) * rates[..., WEIGHT_ROW]
    return transition_loss(rate, points.weights.transition_speed).sum()


@dataclass(frozen=True)
class Term:
    """One term of 𝔏_S.

    summed: over the points of a block that it covers. covers: first and last type of these points; the term is the
    mean over them. weight: its γ in `LossWeights`; None where `summed` has it already.
    """

    summed: Callable[[Points], Tensor]
    covers: types.Span
    weight: str | None


# A new term is an entry here, a function above and its γ in `LossWeights`. In this order they are added.
TERMS = {
    "eikonal": Term(_eikonal_sum, types.EIKONAL, None),
    "depth": Term(_depth_sum, types.GROUND_TRUTH, "depth"),
    "visibility": Term(_visibility_sum, types.GROUND_TRUTH, "visibility"),
    "normals": Term(_normals_sum, types.NORMALS, "normals"),
    "weight_variance": Term(_weight_variance_sum, types.EIKONAL, "weight_variance"),
    "transition": Term(_transition_sum, types.TRANSITION, "transition"),
    "visibility_variance": Term(_visibility_variance_sum, types.GROUND_TRUTH, "visibility_variance"),
}


def _visible(batch: sample_batch.SampleBatch, raw: Tensor, span: types.Span) -> Tensor:
    """ξ of the types from E on; E has no ground truth, so the prediction, detached, stands for it."""
    extra = batch.span("E", "E")
    predicted = torch.sigmoid(raw[:, extra, VISIBILITY_ROW]).detach()
    return torch.cat((predicted, batch.visible[:, extra.stop : batch.span(*span).stop]), dim=1)

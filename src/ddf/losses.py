"""The shape-fitting loss: one function per term, one table of what applies where. Source: [DDF22] §3.4, app. C and E.

A batch holds, for every shape, its samples in the order of `ORDER`, so that what each term reads is one slice: the
directed eikonal E U A B, normals U A B, the transition S T, supervision U A B S T O; nothing reads a derivative on O.
After these may come samples of the same types that are supervised alone, `VALUES_ONLY`: a point without derivatives
costs less than half, and depth is what a small budget should buy first. Every term is the mean over the oriented points
that it applies to (the paper does not say; derived here).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from dataclasses import fields as dataclass_fields
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf import checks, derivatives
from ddf.fields import NUM_COMPONENTS, PDDF, VISIBILITY_ROW, WEIGHT_ROW, first_is_heavier

ORDER = ("E", "U", "A", "B", "S", "T", "O")  # E: extra uniform points, regularised, without ground truth
VALUES_ONLY = ("U+", "A+", "B+", "S+", "T+")  # O has no derivatives anyway
SUPERVISED = (*ORDER[1:], *VALUES_ONLY)
# what applies where: first and last type of the slice that a term covers
EIKONAL, NORMALS, TRANSITION, GROUND_TRUTH = ("E", "B"), ("U", "B"), ("S", "T"), ("U", "T+")
DOUBLED_DEPTH = (("U", "A"), ("U+", "A+"))
TANGENTS = (EIKONAL[0], TRANSITION[1])


@dataclass(frozen=True)
class LossWeights:
    """γ of every term, and ε_T, the transition speed that L_T asks for (the paper gives no value).

    depth is doubled on A and U samples. depth_of: `chosen` is the paper's |d_{i*} - d|, which gives the weights w_i no
    gradient; `mixture` is Σ w_i |d_i - d|, which also moves weight to the better component (derived here).
    depth_huber: error from which L_d grows linearly, see `depth_error`; null for the paper's square.
    """

    depth: float
    depth_of: Literal["chosen", "mixture"]
    depth_huber: float | None
    visibility: float
    normals: float
    weight_variance: float
    eikonal_depth: float
    eikonal_visibility: float
    transition: float
    visibility_variance: float
    transition_speed: float

    def __post_init__(self) -> None:
        for field in dataclass_fields(self):
            value = getattr(self, field.name)
            if field.name == "depth_of":
                continue  # `config` refuses other words
            if field.name == "depth_huber":
                if value is not None and not 0 < value < float("inf"):
                    raise checks.InputError(f"weights.depth_huber must be > 0 and finite, or null; got {value}")
            elif not 0 <= value < float("inf"):
                raise checks.InputError(f"weights.{field.name} must be >= 0 and finite; got {value}")


@dataclass(frozen=True)
class SampleBatch:
    """Oriented points of several shapes in the order of `ORDER` and `VALUES_ONLY`, with their ground truth.

    counts: points per type and shape, none of a type that is absent. The ground truth has entries for E too (never
    read), so that one index fits all. depth: anything finite on a miss. normals: at the hit for U A B, at q_0 for
    S T O.
    """

    positions: Float[Tensor, "shapes n 3"]
    directions: Float[Tensor, "shapes n 3"]
    visible: Float[Tensor, "shapes n"]
    depth: Float[Tensor, "shapes n"]
    normals: Float[Tensor, "shapes n 3"]
    counts: Mapping[str, int]

    def to(self, device: torch.device) -> "SampleBatch":
        """The same batch on another device."""
        tensors = (self.positions, self.directions, self.visible, self.depth, self.normals)
        return SampleBatch(*(tensor.to(device) for tensor in tensors), counts=self.counts)

    def span(self, first: str, last: str) -> slice:
        """The points from type `first` to type `last`, both included."""
        order = (*ORDER, *VALUES_ONLY)
        before = sum(self.counts.get(name, 0) for name in order[: order.index(first)])
        through = sum(self.counts.get(name, 0) for name in order[: order.index(last) + 1])
        return slice(before, through)


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
    raw: Float[Tensor, "*n 4"],
    truth: Float[Tensor, "*n"],
    visible: Float[Tensor, "*n"],
    weights: LossWeights,
) -> Float[Tensor, "*n"]:
    """L_d = ξ |d_{i*} - d|², or the mixture ξ Σ w_i |d_i - d|². The truth may be anything finite where ξ = 0."""
    if weights.depth_of == "chosen":
        return visible * depth_error(field.depth(raw), truth, weights.depth_huber)
    first, second = (depth_error(depth, truth, weights.depth_huber) for depth in field.depths(raw).unbind(-1))
    return visible * torch.lerp(second, first, torch.sigmoid(raw[..., WEIGHT_ROW]))


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
    field: PDDF, batch: SampleBatch, modulations: list[Tensor] | None, weights: LossWeights
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """𝔏_S and its unweighted terms (detached).

    Evaluates: the network at all points, the adjoint of d_{i*} on U A B, one tangent on E U A B (along v) and S T
    (along n), nothing more.
    """
    eikonal, transition = batch.span(*EIKONAL), batch.span(*TRANSITION)
    inputs = torch.cat((batch.positions, batch.directions), dim=-1)
    trace = derivatives.trace(field.network, inputs, modulations, num_slopes=batch.span(*TANGENTS).stop)
    raw = trace.outputs
    along = torch.cat((batch.directions[:, eikonal], batch.normals[:, transition]), dim=1)
    rates = derivatives.tangent(field.network, trace.slopes, along)

    terms = _supervised_terms(field, batch, raw, weights)
    terms["normals"] = _normal_term(field, batch, trace)
    terms["eikonal"] = _eikonal_term(field, batch, raw[:, eikonal], rates[:, eikonal], weights)
    terms["weight_variance"] = bernoulli_variance(raw[:, eikonal, WEIGHT_ROW]).mean()
    weight_rate = bernoulli_variance(raw[:, transition, WEIGHT_ROW]) * rates[:, transition, WEIGHT_ROW]
    terms["transition"] = transition_loss(weight_rate, weights.transition_speed).mean()
    total = terms["eikonal"]  # carries its own two weights
    for name in ("depth", "visibility", "normals", "weight_variance", "transition", "visibility_variance"):
        total = total + getattr(weights, name) * terms[name]
    return total, {name: value.detach() for name, value in terms.items()}


def _supervised_terms(field: PDDF, batch: SampleBatch, raw: Tensor, weights: LossWeights) -> dict[str, Tensor]:
    """Depth, visibility and visibility variance over everything that has ground truth."""
    known = batch.span(*GROUND_TRUTH)
    visible, logits = batch.visible[:, known], raw[:, known, VISIBILITY_ROW]
    depth = depth_loss(field, raw[:, known], batch.depth[:, known], visible, weights)
    doubled = [batch.span(*types) for types in DOUBLED_DEPTH]
    again = sum(depth[:, span.start - known.start : span.stop - known.start].sum() for span in doubled)
    return {
        "depth": (depth.sum() + again) / depth.numel(),
        "visibility": functional.binary_cross_entropy_with_logits(logits, visible),
        "visibility_variance": bernoulli_variance(logits).mean(),
    }


def _normal_term(field: PDDF, batch: SampleBatch, trace: derivatives.Trace) -> Tensor:
    """Mean L_n, from the raw d_{i*}: the positive slope of the depth activation does not turn a normal."""
    span = batch.span(*NORMALS)
    first = first_is_heavier(trace.outputs[:, span]).to(trace.outputs.dtype)
    cotangents = torch.stack((first, 1 - first), dim=-1)
    gradient = derivatives.adjoint(field.network, [slope[:, span] for slope in trace.slopes], cotangents)
    normals = derivatives.normals(gradient, batch.directions[:, span])
    return normal_loss(normals, batch.normals[:, span], batch.visible[:, span]).mean()


def _eikonal_term(field: PDDF, batch: SampleBatch, raw: Tensor, rates: Tensor, weights: LossWeights) -> Tensor:
    """Mean L_DE; where there is no ground truth (E) the predicted visibility, detached, stands for ξ."""
    extra, known = batch.span("E", "E"), batch.span(*NORMALS)
    predicted = torch.sigmoid(raw[:, extra, VISIBILITY_ROW]).detach()
    visible = torch.cat((predicted, batch.visible[:, known]), dim=1)
    depth_rates = field.depth_slopes(raw) * rates[..., :NUM_COMPONENTS]
    visibility_rate = bernoulli_variance(raw[..., VISIBILITY_ROW]) * rates[..., VISIBILITY_ROW]
    return directed_eikonal_loss(depth_rates, visibility_rate, visible, weights).mean()

"""The shape-fitting loss: one function per term, one table of what applies where. Source: [DDF22] §3.4, app. C and E.

A batch holds, for every shape, its samples in the order of `ORDER`, so that what each term reads is one slice: the
directed eikonal E U A B, normals U A B, the transition S T, supervision U A B S T O; nothing reads a derivative on O.
After these may come samples that are supervised alone, `VALUES_ONLY`, of the same types or proposed by the field: a
point without derivatives costs less than half, and depth is what a small budget should buy first. Every term is the
mean over the oriented points that it applies to (the paper does not say; derived here).
"""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from dataclasses import fields as dataclass_fields
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from ddf.core import checks
from ddf.fields import derivatives, passes
from ddf.fields.pddf import DIRECTION, NUM_COMPONENTS, PDDF, VISIBILITY_ROW, WEIGHT_ROW, heavier_rows

ORDER = ("E", "U", "A", "B", "S", "T", "O")  # E: extra uniform points, regularised, without ground truth
STORED_VALUES = ("U+", "A+", "B+", "S+", "T+")  # O has no derivatives anyway
VALUES_ONLY = (*STORED_VALUES, "P")  # P: rays that the field proposes, see `proposed_rays`
STORED = (*ORDER[1:], *STORED_VALUES)
# what applies where: first and last type of the slice that a term covers
EIKONAL, NORMALS, TRANSITION, GROUND_TRUTH = ("E", "B"), ("U", "B"), ("S", "T"), ("U", "P")
CONSISTENCY = ("E", "U")  # the uniform points
DOUBLED_DEPTH = (("U", "A"), ("U+", "A+"), ("P", "P"))
COVERED = {"supervised": GROUND_TRUTH, "normals": NORMALS, "eikonal": EIKONAL, "transition": TRANSITION}
WEIGHTED = ("depth", "visibility", "normals", "weight_variance", "transition", "visibility_variance")
TERMS = (*WEIGHTED, "eikonal")
GOLDEN_SHARE = 0.6180339887  # the fractions of its multiples are spread evenly over (0, 1)
BLOCK_VALUES = {"cpu": 2**19, "cuda": 2**25}  # values of a block: what stays in a CPU's cache, fills a GPU
BLOCK_POINTS = 1400  # of a block of 𝔏_S, for each thread of a CPU, whatever the width; by trial


def block_values(device: torch.device) -> int:
    """How many values, such as points times the widest layer, are worked on at a time."""
    return BLOCK_VALUES.get(device.type, BLOCK_VALUES["cuda"])


def check_counts(name: str, counts: Mapping[str, int]) -> None:
    """Raise unless the points per type of a step have every type, and perhaps some that are supervised alone.

    Raises:
      InputError: a type is missing, unknown or without points; `name` is the config's key.
    """
    if not set(ORDER) <= set(counts) <= {*ORDER, *STORED_VALUES} or min(counts.values()) < 1:
        must, may = ", ".join(ORDER), ", ".join(STORED_VALUES)
        raise checks.InputError(f"{name} must give each of {must} >= 1, may give {may} >= 1; got {counts}")


def sample_type(kind: str) -> str:
    """The sample type of an entry of `STORED`: U+ are U samples, of which no derivative is read."""
    return kind.removesuffix("+")


@dataclass(frozen=True)
class LossWeights:
    """γ of every term, and ε_T, the transition speed that L_T asks for (the paper gives no value).

    depth is doubled on A, U and P. depth_of: `chosen` is the paper's |d_{i*} - d|, which gives the weights w_i no
    gradient; `mixture` is Σ w_i |d_i - d|, which also moves weight to the better component (derived here).
    depth_huber: error from which L_d grows linearly, see `depth_error`; null for the paper's square.
    view_consistency: of `view_consistency_loss`, which the paper does not train with; 0 costs nothing.
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
    view_consistency: float = 0.0

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
    read), so that one index fits all. depth: never read on a miss. normals: at the hit for U A B, at q_0 for
    S T.
    """

    positions: Float[Tensor, "shapes n 3"]
    directions: Float[Tensor, "shapes n 3"]
    visible: Float[Tensor, "shapes n"]
    depth: Float[Tensor, "shapes n"]
    normals: Float[Tensor, "shapes n 3"]
    counts: Mapping[str, int]

    def to(self, device: torch.device) -> "SampleBatch":
        """The same batch on another device."""
        return SampleBatch(*(tensor.to(device) for tensor in self._tensors()), counts=self.counts)

    def followed_by(self, other: "SampleBatch") -> "SampleBatch":
        """This batch with the points of another one, of later types of the same shapes, behind its own."""
        pairs = zip(self._tensors(), other._tensors(), strict=True)
        return SampleBatch(*(torch.cat(pair, dim=1) for pair in pairs), counts={**self.counts, **other.counts})

    def span(self, first: str, last: str) -> slice:
        """The points from type `first` to type `last`, both included."""
        order = (*ORDER, *VALUES_ONLY)
        before = sum(self.counts.get(name, 0) for name in order[: order.index(first)])
        through = sum(self.counts.get(name, 0) for name in order[: order.index(last) + 1])
        return slice(before, through)

    def number(self, first: str, last: str) -> int:
        """How many points of all shapes `span` covers; at least 1, so that it can be divided by."""
        span = self.span(first, last)
        return max(1, len(self.positions) * (span.stop - span.start))

    def blocks(self, points: int) -> Iterator[tuple[slice, "SampleBatch"]]:
        """The same in parts of about `points` points, each a batch in the same order: whole shapes, or parts of one.

        Yields the shapes of each part with it.
        """
        shapes, count = self.visible.shape
        together, parts = max(1, points // count), math.ceil(count / points)
        edges = [round(count * part / parts) for part in range(parts + 1)]
        for first in range(0, shapes, together):
            chosen = slice(first, min(first + together, shapes))
            for rows in itertools.starmap(slice, itertools.pairwise(edges)):
                yield chosen, self._part(chosen, rows)

    def _part(self, shapes: slice, rows: slice) -> "SampleBatch":
        spans = {name: self.span(name, name) for name in self.counts}
        counts = {name: max(0, min(span.stop, rows.stop) - max(span.start, rows.start)) for name, span in spans.items()}
        return SampleBatch(*(tensor[shapes, rows] for tensor in self._tensors()), counts=counts)

    def _tensors(self) -> tuple[Tensor, ...]:
        return self.positions, self.directions, self.visible, self.depth, self.normals


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
    """L_d = ξ |d_{i*} - d|², or the mixture ξ Σ w_i |d_i - d|². Where ξ = 0 the truth is not read."""
    truth = torch.where(visible > 0, truth, 0.0)  # before it is squared: 0 times the overflow of a large one is NaN
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
    field: PDDF,
    batch: SampleBatch,
    modulations: list[Tensor] | None,
    weights: LossWeights,
    matmul: passes.Matmul = "float32",
) -> tuple[Float[Tensor, ""], dict[str, Float[Tensor, ""]]]:
    """𝔏_S and its unweighted terms (detached).

    Evaluates: the network at all points, the adjoint of d_{i*} on U A B, one tangent on E U A B (along v) and S T
    (along n), nothing more. 𝔏_S is a sum over points, so its gradient is made block by block together with its value
    (`passes`), and what autograd sees of it is one node: differentiable once, in the parameters and modulations.

    Args:
      matmul: bfloat16 rounds factors and results of the matrix products between sine layers (`passes.product_type`);
        tf32 is set in `training`.
    """
    inputs = [*(modulations or []), *field.network.parameters()]
    differentiate = torch.is_grad_enabled() and any(tensor.requires_grad for tensor in inputs)
    product = passes.product_type(matmul, field.network.head.weight)
    count = len(modulations or [])
    total, *terms = _ShapeLoss.apply(field, batch, weights, product, count, differentiate, *inputs)
    named: dict[str, Tensor] = dict(zip(TERMS, terms, strict=True))
    if weights.view_consistency:
        consistency = view_consistency_loss(field, batch, modulations, weights)
        total = total + weights.view_consistency * consistency
        named["view_consistency"] = consistency.detach()
    return total, named


def view_consistency_loss(
    field: PDDF, batch: SampleBatch, modulations: list[Tensor] | None, weights: LossWeights
) -> Float[Tensor, ""]:
    """A surface point seen from p and from further along the ray: mean of ξ e(d(p + t v, v), d(p, v) - t) over E and U.

    View consistency asks for d(p_2, v_2) <= t from anywhere ([DDF22] app. `viewconsis`; `shape_diagnostics` measures
    that); along one ray it is this equality, Property I over a finite way, where the directed eikonal loss asks for
    t -> 0. The loss is derived here. t is a share of d_{i*}(p, v) that differs from point to point and is not
    differentiated; e is `depth_error`; ξ is the truth on U, the prediction, detached, on E; what leaves the cube, where
    the field is not trained, counts as 0. Costs two evaluations by autograd.
    """
    span = batch.span(*CONSISTENCY)
    positions, directions = batch.positions[:, span], batch.directions[:, span]
    raw = field(positions, directions, modulations)
    depth = field.depth(raw)
    with torch.no_grad():
        place = torch.arange(1, depth.shape[1] + 1, dtype=torch.float64, device=depth.device)
        way = depth * (place * GOLDEN_SHARE).frac().to(depth.dtype)
        further = positions + way[..., None] * directions
        inside = (further.abs() <= 1).all(dim=-1)
        visible = _visible(batch, raw, CONSISTENCY) * inside
    left = field.depth(field(further, directions, modulations))
    error = visible * depth_error(left, depth - way, weights.depth_huber)
    return error.sum() / batch.number(*CONSISTENCY)


class _ShapeLoss(torch.autograd.Function):
    """𝔏_S and its terms; the gradient is made in the forward pass and scaled in the backward pass."""

    @staticmethod
    def forward(
        ctx,
        field: PDDF,
        batch: SampleBatch,
        weights: LossWeights,
        product: torch.dtype,
        count: int,
        differentiate: bool,
        *inputs: Tensor,
    ) -> tuple[Tensor, ...]:
        modulations = [modulation.detach() for modulation in inputs[:count]]
        parameters = passes.Parameters(field.network, product)
        found = [torch.zeros_like(modulation) for modulation in modulations]
        sums = torch.zeros(1 + len(TERMS), dtype=parameters.dtype, device=parameters.head.device)
        numbers = {name: batch.number(*span) for name, span in COVERED.items()}
        for shapes, block in batch.blocks(_block_points(field)):
            part = [modulation[shapes] for modulation in modulations] if count else None
            values, gradients = _block_loss(field, block, part, weights, parameters, numbers, differentiate)
            sums += values
            for whole, gradient in zip(found, gradients, strict=False):
                whole[shapes] += gradient
        total, *terms = sums.unbind()
        ctx.mark_non_differentiable(*terms)
        if differentiate:
            ctx.save_for_backward(*found, *parameters.gradients())
        return total, *terms

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, grad_total: Tensor, *_: Tensor) -> tuple[Tensor | None, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        needed = ctx.needs_input_grad[6:]
        scaled = [grad_total * saved if need else None for saved, need in zip(ctx.saved_tensors, needed, strict=True)]
        return *([None] * 6), *scaled


def _block_points(field: PDDF) -> int:
    """Points in a block; a CPU's threads share each product of a block, so more of them take a larger one."""
    device = field.network.head.weight.device
    if device.type == "cpu":
        return BLOCK_POINTS * torch.get_num_threads()
    return max(1, block_values(device) // max(field.config.hidden))


def _block_loss(
    field: PDDF,
    block: SampleBatch,
    modulations: list[Tensor] | None,
    weights: LossWeights,
    parameters: passes.Parameters,
    numbers: Mapping[str, int],
    differentiate: bool,
) -> tuple[Float[Tensor, "terms"], list[Tensor]]:
    """𝔏_S and its terms, as far as a block goes, and the gradient in the block's modulations.

    Args:
      numbers: points of the whole batch that each entry of `COVERED` covers.
    """
    inputs = field.inputs(block.positions, block.directions)
    # as the network knows them: every term is the same for mirror images
    known = field.turned(block.normals, block.directions)
    block = replace(block, directions=inputs[..., DIRECTION], normals=known)
    eikonal, transition, normals = block.span(*EIKONAL), block.span(*TRANSITION), block.span(*NORMALS)
    along = torch.cat((block.directions[:, eikonal], block.normals[:, transition]), dim=1)
    states = passes.Block(parameters, inputs, along, modulations)
    gradient = states.adjoint(normals, heavier_rows(states.outputs[:, normals]))
    with torch.set_grad_enabled(differentiate):
        leaves = [each.detach().requires_grad_(differentiate) for each in (states.outputs, states.rates, gradient)]
        terms = _terms(field, block, (leaves[0], leaves[1], leaves[2]), weights, numbers)
        total = terms["eikonal"]  # carries its own two weights
        for name in WEIGHTED:
            total = total + getattr(weights, name) * terms[name]
        found = []
        if differentiate:
            found = states.reverse(*torch.autograd.grad(total, leaves, materialize_grads=True))
    return torch.stack([total, *(terms[name] for name in TERMS)]).detach(), found


def _terms(
    field: PDDF,
    block: SampleBatch,
    found: tuple[Tensor, Tensor, Tensor],
    weights: LossWeights,
    numbers: Mapping[str, int],
) -> dict[str, Float[Tensor, ""]]:
    """What a block adds to every term. The raw d_{i*} gives the normal: a positive slope does not turn it.

    Args:
      found: outputs and rates of `passes.Block`, and ∇_p of raw d_{i*} on U A B.
    """
    raw, rates, gradient = found
    eikonal, transition, normals = block.span(*EIKONAL), block.span(*TRANSITION), block.span(*NORMALS)
    terms = _supervised_terms(field, block, raw, weights, numbers["supervised"])
    facing = derivatives.normals(gradient, block.directions[:, normals])
    alignment = normal_loss(facing, block.normals[:, normals], block.visible[:, normals])
    terms["normals"] = alignment.sum() / numbers["normals"]
    terms["eikonal"] = _eikonal_sum(field, block, raw[:, eikonal], rates[:, eikonal], weights) / numbers["eikonal"]
    terms["weight_variance"] = bernoulli_variance(raw[:, eikonal, WEIGHT_ROW]).sum() / numbers["eikonal"]
    weight_rate = bernoulli_variance(raw[:, transition, WEIGHT_ROW]) * rates[:, transition, WEIGHT_ROW]
    terms["transition"] = transition_loss(weight_rate, weights.transition_speed).sum() / numbers["transition"]
    return terms


def _supervised_terms(
    field: PDDF, block: SampleBatch, raw: Tensor, weights: LossWeights, number: int
) -> dict[str, Tensor]:
    """Depth, visibility and visibility variance over everything that has ground truth."""
    known = block.span(*GROUND_TRUTH)
    visible, logits = block.visible[:, known], raw[:, known, VISIBILITY_ROW]
    depth = depth_loss(field, raw[:, known], block.depth[:, known], visible, weights)
    doubled = [block.span(*types) for types in DOUBLED_DEPTH]
    again = sum(depth[:, span.start - known.start : span.stop - known.start].sum() for span in doubled)
    return {
        "depth": (depth.sum() + again) / number,
        "visibility": functional.binary_cross_entropy_with_logits(logits, visible, reduction="sum") / number,
        "visibility_variance": bernoulli_variance(logits).sum() / number,
    }


def _visible(batch: SampleBatch, raw: Tensor, types: tuple[str, str]) -> Tensor:
    """ξ of the types from E on; E has no ground truth, so the prediction, detached, stands for it."""
    extra = batch.span("E", "E")
    predicted = torch.sigmoid(raw[:, extra, VISIBILITY_ROW]).detach()
    return torch.cat((predicted, batch.visible[:, extra.stop : batch.span(*types).stop]), dim=1)


def _eikonal_sum(field: PDDF, block: SampleBatch, raw: Tensor, rates: Tensor, weights: LossWeights) -> Tensor:
    """Sum of L_DE."""
    visible = _visible(block, raw, EIKONAL)
    depth_rates = field.depth_slopes(raw) * rates[..., :NUM_COMPONENTS]
    visibility_rate = bernoulli_variance(raw[..., VISIBILITY_ROW]) * rates[..., VISIBILITY_ROW]
    return directed_eikonal_loss(depth_rates, visibility_rate, visible, weights).sum()

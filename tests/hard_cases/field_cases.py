"""Hard values of a field's outputs: saturated, zero, far below zero, undecided, large. Truth: constant fields."""

import math

import torch
from torch import Tensor

from ddf.fields import derivatives, field_outputs, field_values, losses, pddf
from ddf.geometry import rays

from . import case
from .ray_cases import SLOPES

FIELDS = case.Group("fields")
SATURATED = 1e4  # a logit


def constant_field(
    raw: tuple[float, float, float, float], dtype: torch.dtype, config: pddf.PDDFConfig | None = None
) -> pddf.PDDF:
    """A field with these raw outputs (d_1, d_2, logit w_1, logit ξ) everywhere; its sine layer is random."""
    torch.manual_seed(0)
    field = pddf.PDDF(config or pddf.PDDFConfig((8,), 1.0, 1.0, "relu", 1.0)).to(dtype)
    with torch.no_grad():
        field.network.head.weight.zero_()
        field.network.head.bias.copy_(torch.tensor(raw, dtype=torch.float64))
    return field


def _raw(dtype: torch.dtype, *rows: tuple[float, float, float, float]) -> Tensor:
    return torch.tensor(rows, dtype=dtype, requires_grad=True)


@FIELDS.case(
    "saturated visibility",
    "logits of ξ of 1e4 and -1e4",
    "ξ exactly 1 and 0, ξ(1 - ξ) exactly 0, and a gradient of exactly 0",
)
def _saturated(dtype: torch.dtype) -> case.Outcome:
    raw = _raw(dtype, (1, 1, 0, SATURATED), (1, 1, 0, -SATURATED))
    visibility = pddf.visibility(raw)
    variance = losses.bernoulli_variance(raw[:, 3])
    (gradient,) = torch.autograd.grad((visibility + variance).sum(), raw)
    return case.worst(
        case.exact(visibility, [1.0, 0.0]), case.exact(variance, [0.0, 0.0]), case.exact(gradient, torch.zeros(2, 4))
    )


@FIELDS.case(
    "w_1 at 1 and at 0",
    "logits of w_1 of 1e4 and -1e4, depths 1 and 3, truth 1.5",
    "depth 1 and 3; mixture error 0.25 and 2.25; w_1 w_2 = 0; finite gradients",
)
def _weights(dtype: torch.dtype) -> case.Outcome:
    field = constant_field((1, 1, 0, 0), dtype)
    raw = _raw(dtype, (1, 3, SATURATED, 0), (1, 3, -SATURATED, 0))
    truth, seen = torch.full((2,), 1.5, dtype=dtype), torch.ones(2, dtype=dtype)
    weights = losses.LossWeights(
        depth=1.0,
        depth_of="mixture",
        visibility=1.0,
        normals=1.0,
        eikonal_depth=1.0,
        eikonal_visibility=1.0,
        transition=1.0,
        visibility_variance=1.0,
    )
    error = losses.depth_loss(field, raw, truth, seen, weights)
    variance = losses.bernoulli_variance(raw[:, 2])
    (gradient,) = torch.autograd.grad((error + variance).sum(), raw)
    expected = torch.tensor([[-1.0, 0, 0, 0], [0, 3, 0, 0]])  # 2 (d - truth) on the component that counts
    return case.worst(
        case.exact(field.depth(raw), [1.0, 3.0]),
        case.exact(error, [0.25, 2.25]),
        case.exact(variance, [0.0, 0.0]),
        case.exact(gradient, expected),
    )


@FIELDS.case(
    "both components equally heavy",
    "logits of w_1 of 0, -0, and the smallest numbers beside 0; depths 1 and 3",
    "the first where w_1 >= 1/2, and one-hot rows that agree",
)
def _undecided(dtype: torch.dtype) -> case.Outcome:
    tiny = torch.finfo(dtype).tiny
    raw = _raw(dtype, *((1, 3, logit, 0) for logit in (0.0, -0.0, tiny, -tiny)))
    field = constant_field((1, 1, 0, 0), dtype)
    return case.every(
        case.exact(field.depth(raw), [1.0, 1.0, 1.0, 3.0]),
        case.exact(pddf.heavier_rows(raw)[:, 0], [1.0, 1.0, 1.0, 0.0]),
    )


@FIELDS.case(
    "d = 0",
    "raw depths of 0, -0 and -5 under ReLU; surface points q = p + d v",
    "depth exactly 0 and q = p",
)
def _zero_depth(dtype: torch.dtype) -> case.Outcome:
    field = constant_field((1, 1, 0, 0), dtype)
    depth = field.depth(_raw(dtype, (0, 1, 9, 0), (-0.0, 1, 9, 0), (-5, 1, 9, 0)))
    p, v = torch.full((3, 3), 0.1, dtype=dtype), torch.tensor([[0.6, 0.0, -0.8]], dtype=dtype).expand(3, 3)
    return case.worst(case.exact(depth, torch.zeros(3)), case.exact(rays.surface_points(p, v, depth), p))


@FIELDS.case(
    "softplus depth far from zero",
    "raw depths of -1e4, -1, 1 and 1e4 with sharpness 100",
    "0, 0, 1 and 1e4 within 1e-43 (e^-100 is 4e-44); slopes 0, 0, 1 and 1, the gradient too",
)
def _softplus(dtype: torch.dtype) -> case.Outcome:
    config = pddf.PDDFConfig((8,), 1.0, 1.0, "softplus", 100.0)
    field = constant_field((1, 1, 0, 0), dtype, config)
    raw = _raw(dtype, *((d, 1, 9, 0) for d in (-1e4, -1, 1, 1e4)))
    depth = field.depth(raw)
    (gradient,) = torch.autograd.grad(depth.sum(), raw)
    slopes = field.depth_slopes(raw)[:, 0]
    return case.worst(
        case.close(depth, [0.0, 0.0, 1.0, 1e4], 1e-43),
        case.close(slopes, [0.0, 0.0, 1.0, 1.0], 1e-43),
        case.close(gradient[:, 0], [0.0, 0.0, 1.0, 1.0], 1e-43),
    )


@FIELDS.case(
    "numbers of float16's range in a sine layer",
    "y = sin x at x = ±65504 (float16's largest) and ±6e-8 (its smallest)",
    "the sine of the very argument, within ε",
)
def _float16_range(dtype: torch.dtype) -> case.Outcome:
    field = constant_field((0, 0, 9, 0), dtype)
    layer, head = field.network.layers[0], field.network.head
    with torch.no_grad():
        for parameter in (layer.weight, layer.bias):
            parameter.zero_()
        layer.weight[0, 0] = 1.0
        head.weight[0, 0] = 1.0
    x = [65504.0, -65504.0, 2.0**-24, -(2.0**-24)]
    positions = torch.zeros(4, 3, dtype=dtype)
    positions[:, 0] = torch.tensor(x, dtype=dtype)
    raw = field(positions, torch.zeros_like(positions))
    return case.close(raw[:, 0], [math.sin(value) for value in x], case.step(dtype))


@FIELDS.case(
    "normals at grazing angles",
    "∇_p d = -n/(n·v) for |n·v| = 1, 1e-1, ..., 1e-4 and both signs of the gradient",
    "n within 2 ε, n·v < 0",
)
def _grazing_normals(dtype: torch.dtype) -> case.Outcome:
    truth = torch.tensor([0.48, -0.6, 0.64], dtype=torch.float64)
    across = torch.tensor([0.8, 0.0, -0.6], dtype=torch.float64)
    found = []
    for slope in SLOPES:
        v = (math.sqrt(1 - slope * slope) * across - slope * truth).to(dtype)
        for sign in (1.0, -1.0):
            gradient = (sign / slope * truth).to(dtype)
            found.append(case.close(derivatives.normals(gradient[None], v[None])[0], truth, 2 * case.step(dtype)))
    return case.worst(*found)


@FIELDS.case(
    "normals where depth does not change",
    "∇_p d = 0 exactly",
    "the zero vector, with a finite gradient",
)
def _no_normal(dtype: torch.dtype) -> case.Outcome:
    gradient = torch.zeros(1, 3, dtype=dtype, requires_grad=True)
    v = torch.tensor([[0.0, 1.0, 0.0]], dtype=dtype)
    found = derivatives.normals(gradient, v)
    (back,) = torch.autograd.grad(found.sum(), gradient)
    return case.every(case.exact(found, torch.zeros(1, 3)), case.true("finite gradient", torch.isfinite(back)))


@FIELDS.case("a query of no rays", "arrays of shape (0, 3), all outputs", "arrays of length 0")
def _no_rays(dtype: torch.dtype) -> case.Outcome:
    nothing = torch.zeros(0, 3, dtype=dtype)
    field = constant_field((1, 1, 0, 0), dtype)
    found = field_values.evaluate(field, nothing, nothing, field_outputs.DEFAULT)
    shapes = [tuple(found[name].shape) for name in ("visibility", "depth", "normals")]
    return case.Outcome(f"shapes {shapes}", shapes == [(0,), (0,), (0, 3)])

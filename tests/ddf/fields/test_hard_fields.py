"""Hard values of a field's outputs: saturated, zero, far below zero, undecided, large, grazing.

Truth: constant fields; and networks whose depth has the exact value, gradient and Hessian of a shape's. With n the
normal that faces the viewer, s = |n·v|, principal curvatures κ_i along t_i (signs as in `primitives`) and
P = I + v ∇d^T, differentiating F(p + d v) = 0 twice gives (derived here)

  ∇d = n/s,  H[d] = -1/s Σ_i κ_i a_i a_i^T,  a_i = P^T t_i = t_i + n (v·t_i)/s.

Three sine units have these at p = 0: sin(∇d·p) the gradient, κ_i/s (sin(a_i·p + π/2) - 1) each term of the Hessian.
"""

import math

import pytest
import torch
from _hard import SATURATED, SLOPES, assert_exact, assert_within, constant_field, step
from torch.nn import functional

from ddf.fields import derivatives, losses, pddf


def _raw(dtype, *rows):
    return torch.tensor(rows, dtype=dtype, requires_grad=True)


def test_saturated_visibility_is_exact_and_has_no_slope(dtype):
    raw = _raw(dtype, (1, 1, 0, SATURATED), (1, 1, 0, -SATURATED))
    visibility, variance = pddf.visibility(raw), losses.bernoulli_variance(raw[:, 3])
    (gradient,) = torch.autograd.grad((visibility + variance).sum(), raw)
    assert_exact(visibility, [1.0, 0.0])
    assert_exact(variance, [0.0, 0.0])
    assert_exact(gradient, torch.zeros(2, 4))


def test_saturated_weights_leave_the_error_of_one_component(dtype):
    """Depths 1 and 3, truth 1.5: mixture error 0.25 and 2.25, slope 2 (d - truth) on the component that counts."""
    field = constant_field((1, 1, 0, 0), dtype)
    raw = _raw(dtype, (1, 3, SATURATED, 0), (1, 3, -SATURATED, 0))
    truth, seen = torch.full((2,), 1.5, dtype=dtype), torch.ones(2, dtype=dtype)
    error = losses.depth_loss(field, raw, truth, seen, losses.LossWeights(depth=1.0, depth_of="mixture"))
    (gradient,) = torch.autograd.grad(error.sum(), raw)
    assert_exact(field.depth(raw), [1.0, 3.0])
    assert_exact(error, [0.25, 2.25])
    assert_exact(gradient, torch.tensor([[-1.0, 0, 0, 0], [0, 3, 0, 0]]))


def test_of_two_equally_heavy_components_the_first_counts(dtype):
    tiny = torch.finfo(dtype).tiny
    raw = _raw(dtype, *((1, 3, logit, 0) for logit in (0.0, -0.0, tiny, -tiny)))
    assert_exact(constant_field((1, 1, 0, 0), dtype).depth(raw), [1.0, 1.0, 1.0, 3.0])
    assert_exact(pddf.heavier_rows(raw)[:, 0], [1.0, 1.0, 1.0, 0.0])


def test_softplus_far_from_zero_is_relu_with_its_slopes(dtype):
    """Raw depths of -1e4, -1, 1, 1e4, sharpness 100; e^-100 is 4e-44."""
    field = constant_field((1, 1, 0, 0), dtype, pddf.PDDFConfig((8,), 1.0, 1.0, "softplus", 100.0))
    raw = _raw(dtype, *((d, 1, 9, 0) for d in (-1e4, -1, 1, 1e4)))
    depth = field.depth(raw)
    (gradient,) = torch.autograd.grad(depth.sum(), raw)
    assert_within(depth, [0.0, 0.0, 1.0, 1e4], 1e-43)
    assert_within(field.depth_slopes(raw)[:, 0], [0.0, 0.0, 1.0, 1.0], 1e-43)
    assert_within(gradient[:, 0], [0.0, 0.0, 1.0, 1.0], 1e-43)


def test_a_sine_layer_at_the_ends_of_float16_gives_the_sine_of_its_argument(dtype):
    field = constant_field((0, 0, 9, 0), dtype)
    layer, head = field.network.layers[0], field.network.head
    with torch.no_grad():
        for parameter in (layer.weight, layer.bias):
            parameter.zero_()
        layer.weight[0, 0] = head.weight[0, 0] = 1.0
    x = [65504.0, -65504.0, 2.0**-24, -(2.0**-24)]
    positions = torch.zeros(4, 3, dtype=dtype)
    positions[:, 0] = torch.tensor(x, dtype=dtype)
    assert_within(field(positions, torch.zeros_like(positions))[:, 0], [math.sin(value) for value in x], step(dtype))


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_normals_at_grazing_angles_face_the_viewer(slope, sign, dtype):
    truth = torch.tensor([0.48, -0.6, 0.64], dtype=torch.float64)
    across = torch.tensor([0.8, 0.0, -0.6], dtype=torch.float64)
    v = (math.sqrt(1 - slope * slope) * across - slope * truth).to(dtype)
    found = derivatives.normals((sign / slope * truth).to(dtype)[None], v[None])
    assert_within(found[0], truth, 2 * step(dtype))


def test_where_depth_does_not_change_the_normal_is_zero_with_a_finite_gradient(dtype):
    gradient = torch.zeros(1, 3, dtype=dtype, requires_grad=True)
    found = derivatives.normals(gradient, torch.tensor([[0.0, 1.0, 0.0]], dtype=dtype))
    (back,) = torch.autograd.grad(found.sum(), gradient)
    assert_exact(found, torch.zeros(1, 3))
    assert torch.isfinite(back).all()


def _two_jet_field(v, n, tangents, kappa, dtype):
    """The field of the module's docstring, seen from p = 0 along v, at depth 2; tangents: t_1 and t_2 as rows."""
    slope = float(-(n * v).sum())
    field = pddf.PDDF(pddf.PDDFConfig((3,), 1.0, 1.0, "relu", 1.0))
    layer, head = field.network.layers[0], field.network.head
    heights = torch.tensor([1.0, kappa[0] / slope, kappa[1] / slope], dtype=torch.float64)
    with torch.no_grad():
        field.double()
        for parameter in field.parameters():
            parameter.zero_()
        layer.weight[0, :3] = n / slope
        layer.weight[1:, :3] = tangents + (tangents @ v)[:, None] * n / slope
        layer.bias[1:] = math.pi / 2
        head.weight[0] = heights
        head.bias[0] = 2.0 - heights[1:].sum()
        head.bias[2] = 9.0  # the first component is the heavier
    return field.to(dtype).requires_grad_(False)


TURN = torch.tensor([[0.48, 0.8, 0.36], [-0.6, 0.0, 0.8], [0.64, -0.6, 0.48]], dtype=torch.float64)  # no round number
PLACES = {  # side of the viewer, κ along y and z
    "plane": (1.0, (0.0, 0.0)),
    "sphere from outside": (1.0, (-2.0, -2.0)),
    "sphere from inside": (-1.0, (2.0, 2.0)),
    "torus, outermost circle": (1.0, (-4.0, -1.0)),
    "torus, innermost circle": (-1.0, (-4.0, 2.0)),
}


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("place", PLACES)
def test_curvatures_at_grazing_angles_are_those_of_the_shape(place, slope, dtype):
    """v along no principal direction; within 8 ε/|n·v|, the rounding of a tangent over the slope."""
    side, kappa = PLACES[place]
    frame, largest = torch.eye(3, dtype=torch.float64), max(map(abs, kappa))
    normal, across = side * frame[0], functional.normalize(frame[1] + frame[2], dim=0)
    v = math.sqrt(1 - slope * slope) * across - slope * normal
    field = _two_jet_field(TURN @ v, TURN @ normal, frame[1:] @ TURN.T, kappa, dtype)
    surface = derivatives.Surface(field, torch.zeros(1, 3, dtype=dtype), (TURN @ v).to(dtype)[None])
    assert_within(surface.normals[0], TURN @ normal, 4 * step(dtype))
    assert_within(surface.gaussian, [kappa[0] * kappa[1]], 8 * step(dtype) / slope * largest**2)
    assert_within(surface.mean, [sum(kappa)], 8 * step(dtype) / slope * largest)

"""Hard batches, masks and cameras in training. Truth: fields with constant outputs, whose losses have a closed form."""

import dataclasses
import math

import _models
import pytest
import torch
from _hard import SATURATED, assert_exact, assert_refused, assert_within, constant_field, step

from ddf.fields import losses, pddf
from ddf.geometry import transforms
from ddf.models import camera_encoder, reconstruction_models, reconstruction_settings
from ddf.reconstruction import mask_descent

COUNTS = {"E": 3, "U": 5, "A": 6, "B": 4, "S": 2, "T": 3, "O": 2, "U+": 4}
WEIGHTS = losses.LossWeights(transition_speed=1.5)
ONLY_VALUES = dataclasses.replace(
    WEIGHTS, eikonal_depth=0.0, eikonal_visibility=0.0, weight_variance=0.0, transition=0.0
)


def _batch(dtype, visible, depth):
    """Random oriented points of two shapes, all with the same ground truth; normals are zero, as they are on misses."""
    made = _models.batch(COUNTS, dtype=dtype)
    same = torch.ones_like(made.depth)
    return dataclasses.replace(made, visible=visible * same, depth=depth * same, normals=0 * made.normals)


def _loss(field, batch, weights=WEIGHTS):
    """𝔏_S, its gradient in the head's biases, and its terms; every gradient is finite."""
    loss, terms = losses.shape_loss(field, batch, None, weights)
    gradients = torch.autograd.grad(loss, list(field.parameters()))
    assert all(torch.isfinite(g).all() for g in (loss, *gradients))
    return loss, gradients[-1], terms


def _miss_loss(b):
    """𝔏_S of a field with ξ logit b and w_1 = 1/2 everywhere when every ray misses, and its gradient in the biases.

    No depth, no normals; log(1 + e^b) of visibility, ξ(1 - ξ), w_1 w_2 = 1/4, ε_T², and the eikonal's 2 ξ on E.
    """
    xi = 1 / (1 + math.exp(-b))
    known = COUNTS["E"] / sum(COUNTS[kind] for kind in "EUAB")
    loss = WEIGHTS.visibility * math.log1p(math.exp(b)) + WEIGHTS.visibility_variance * xi * (1 - xi)
    loss += WEIGHTS.weight_variance / 4 + WEIGHTS.transition * WEIGHTS.transition_speed**2
    loss += WEIGHTS.eikonal_depth * 2 * xi * known
    slope = WEIGHTS.visibility * xi + WEIGHTS.visibility_variance * xi * (1 - xi) * (1 - 2 * xi)
    return loss, [0.0, 0.0, 0.0, slope]  # ξ of the eikonal on E is not followed


def test_the_loss_of_rays_that_all_miss_has_a_closed_form(dtype):
    loss, gradient, _ = _loss(constant_field((1, 2, 0, 0.7), dtype), _batch(dtype, 0.0, 0.0))
    value, slopes = _miss_loss(0.7)
    assert_within(gradient, slopes, 64 * step(dtype) * WEIGHTS.visibility)
    assert_within(loss, value, 64 * step(dtype) * WEIGHTS.visibility)


@pytest.mark.parametrize("visible", [1.0, 0.0])
@pytest.mark.parametrize("logit", [-SATURATED, SATURATED])
def test_saturated_visibility_costs_its_logit_where_it_is_wrong(visible, logit, dtype):
    field = constant_field((1, 2, 0, logit), dtype)
    loss, gradient, _ = _loss(field, _batch(dtype, visible, 1.0), ONLY_VALUES)
    wrong = (logit > 0) != (visible > 0)
    slope = math.copysign(WEIGHTS.visibility, logit) * wrong
    assert_within(gradient, [0, 0, 0, slope], 64 * step(dtype) * abs(slope))
    assert_within(loss, WEIGHTS.visibility * SATURATED * wrong, step(dtype) * 1e5 * wrong)


@pytest.mark.parametrize("logit", [SATURATED, -SATURATED])
def test_a_saturated_weight_has_no_variance_and_no_speed(logit, dtype):
    field = constant_field((1, 2, logit, 0.7), dtype)
    with torch.no_grad():
        field.network.head.weight[2] = 1.0  # w_1's logit does change along the rays
    terms = _loss(field, _batch(dtype, 0.0, 0.0))[2]
    assert_exact(terms["weight_variance"], 0.0)
    assert_exact(terms["transition"], WEIGHTS.transition_speed**2)


def test_softplus_far_below_zero_has_its_error_and_no_slope(dtype):
    """Every ray hits at depth 0.5: 1/4, doubled on U, U+ and A."""
    config = pddf.PDDFConfig((8,), 1.0, 1.0, "softplus", 100.0)
    _, gradient, terms = _loss(constant_field((-1e4, -1e4, 0, 0.7), dtype, config), _batch(dtype, 1.0, 0.5))
    known = sum(COUNTS.values()) - COUNTS["E"]
    doubled = COUNTS["U"] + COUNTS["A"] + COUNTS["U+"]
    assert_exact(gradient[:2], [0.0, 0.0])
    assert_within(terms["depth"], 0.25 * (known + doubled) / known, 8 * step(dtype))


def _mask_loss(alpha, size, radius, logit, dtype):
    """L_M of a constant field, its gradient in the camera."""
    camera = torch.tensor([[0.3, 0.2, radius]], dtype=dtype, requires_grad=True)
    scale = torch.tensor([transforms.BENCHMARK_FROM_V1], dtype=dtype)
    field, modulations = constant_field((1, 1, 0, logit), dtype), [torch.ones(1, 1, 8, dtype=dtype)]
    mask = torch.full((1, size, size), alpha, dtype=dtype)
    loss = reconstruction_models.mask_loss(field, modulations, camera, scale, mask)
    return loss, torch.autograd.grad(loss.sum(), camera)[0]


@pytest.mark.parametrize("alpha", [0.0, 1.0])
@pytest.mark.parametrize("logit", [SATURATED, -SATURATED, 0.7])
def test_a_mask_of_one_value_costs_its_cross_entropy_and_moves_no_camera(alpha, logit, dtype):
    """Seen from inside the cube, all 64 pixels count: log(1 + e^±b), 0 or 1e4."""
    loss, gradient = _mask_loss(alpha, 8, 0.4, logit, dtype)
    wrong = logit if alpha == 0 else -logit
    expected = max(wrong, 0.0) + math.log1p(math.exp(-abs(wrong)))
    assert_exact(gradient, torch.zeros(1, 3))
    assert_within(loss, [expected], 4 * step(dtype) * max(expected, 1.0))


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_a_mask_whose_every_ray_misses_costs_what_torch_bounds(alpha, dtype):
    """A camera 1e3 box lengths away: 100 where -log 0 is meant."""
    loss, gradient = _mask_loss(alpha, 4, 2000.0, 0.7, dtype)
    assert_exact(loss, [100 * alpha])
    assert_exact(gradient, torch.zeros(1, 3))


@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_a_camera_without_a_slope_stays_where_it_is(alpha, dtype):
    """Descent on L_M through a field of constant visibility; 2 ε: to z-scores and back."""
    torch.manual_seed(0)
    model, _ = _models.of_field(pddf.PDDFConfig((8,), 1.0, 1.0, "relu", 1.0), 2, 1)
    model.camera_head.fit(torch.tensor([[0.1, 0.2, 0.3], [0.5, 0.4, 0.6]]))
    with torch.no_grad():
        model.field.network.head.weight.zero_()
    model = model.to(dtype).requires_grad_(False)
    camera, scale = torch.tensor([[0.25, 0.25, 0.5]], dtype=dtype), torch.tensor([0.6], dtype=dtype)
    correction = reconstruction_settings.CorrectionConfig(3, 0.1, 8, ("azimuth", "radius"))
    modulations, mask = model.modulations(torch.zeros(1, 2, dtype=dtype)), torch.full((1, 8, 8), alpha, dtype=dtype)
    corrected = mask_descent.correct_camera(model, modulations, camera, scale, mask, correction)
    assert_within(corrected, camera, 2 * step(dtype))


@pytest.mark.parametrize(
    ("count", "told"),
    [(0, "must be at least 2; got 0"), (1, "must be at least 2; got 1"), (2, "elevation and radius must vary")],
)
def test_training_cameras_without_a_spread_are_refused(count, told, dtype):
    head = camera_encoder.CameraHead().to(dtype)
    same_radius = torch.tensor([[0.1, 0.2, 0.5], [0.3, 0.4, 0.5]], dtype=dtype)
    assert_refused(lambda: head.fit(same_radius[:count]), told)

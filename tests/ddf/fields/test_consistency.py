"""Consistency losses: against slow loops, against autograd through one derivative at a time, and on an exact field."""

import _models
import torch
from _support import assert_close
from torch import nn

from ddf.fields import consistency, pddf
from ddf.fit import field_diagnostics


def _double_field():
    return _models.field().double().requires_grad_()


def _double_points(count, seed=0):
    positions, directions = (values.double() for values in _models.points(count, seed))
    return positions, nn.functional.normalize(directions, dim=-1)


def _answers(field):
    def answers(positions, directions):
        raw = field(positions, directions)
        return field.depth(raw), pddf.visibility(raw)

    return answers


def test_gradient_loss_is_the_mean_square_of_the_measured_residual():
    field = _double_field()
    positions, directions = _double_points(50)
    residuals = field_diagnostics.residuals(_answers(field), positions, directions, positions.roll(1, 0))
    seen = (_answers(field)(positions, directions)[1] >= 0.5).double()
    found = consistency.gradient_loss(field, positions, directions, seen)
    assert_close(found, residuals["gradient_consistency"].square().sum() / 50)
    assert seen.sum() > 0 and float(found.detach()) > 0


def test_gradient_loss_differentiates_in_every_layer():
    field = _double_field()
    positions, directions = _double_points(20)
    loss = consistency.gradient_loss(field, positions, directions, torch.ones(20, dtype=torch.float64))
    gradients = torch.autograd.grad(loss, [layer.weight for layer in field.network.layers])
    parameter = field.network.layers[1].weight
    with torch.no_grad():
        step = torch.zeros_like(parameter)
        step[2, 3] = 1e-6
        values = []
        for sign in (1, -1):
            parameter += sign * step
            values.append(consistency.gradient_loss(field, positions, directions, torch.ones(20).double()))
            parameter -= sign * step
    assert_close(gradients[1][2, 3], (values[0] - values[1]) / 2e-6, rtol=1e-5)
    assert all(gradient.abs().sum() > 0 for gradient in gradients)


def test_view_loss_equals_the_inequality_written_as_a_loop():
    field = _double_field()
    surface_points, _ = _double_points(30)
    starts, _ = _double_points(30, 1)
    visible = (torch.arange(30) % 3 > 0).double()
    total = 0.0
    for q, p, seen in zip(surface_points, starts, visible, strict=True):
        t = (q - p).norm()
        raw = field(p[None], ((q - p) / t)[None])
        depth, share = field.depth(raw)[0], pddf.visibility(raw)[0]
        total = total + seen * (-torch.log(share) + 2 * torch.clamp(depth - t, min=0))
    found = consistency.view_loss(field, surface_points, starts, visible)
    assert_close(found, total / 30)
    found.backward()
    assert all(value.grad.abs().sum() > 0 for value in field.parameters() if value.grad is not None)


def _constant_field(depth, logit):
    """A field that says the same along every ray."""
    field = _double_field()
    with torch.no_grad():
        field.network.head.weight.zero_()
        field.network.head.bias.copy_(torch.tensor([depth, depth, 0.0, logit]))
    return field


def test_view_loss_is_nothing_where_the_field_sees_something_no_farther():
    points, _ = _double_points(40)
    starts = points + torch.tensor([0.0, 0.0, 0.5], dtype=torch.float64)
    everything = torch.ones(40, dtype=torch.float64)
    near = consistency.view_loss(_constant_field(0.4, 40.0), points, starts, everything)
    far = consistency.view_loss(_constant_field(0.7, 40.0), points, starts, everything)
    blind = consistency.view_loss(_constant_field(0.4, 0.0), points, starts, everything)
    assert_close(near, torch.tensor(0.0, dtype=torch.float64), atol=1e-9)
    assert_close(far, torch.tensor(0.4, dtype=torch.float64), rtol=1e-3)
    assert_close(blind, torch.tensor(2.0, dtype=torch.float64).log(), rtol=1e-6)


def test_view_loss_leaves_out_what_is_not_visible_and_starts_on_the_point():
    points, _ = _double_points(10)
    field = _constant_field(0.7, 0.0)
    assert consistency.view_loss(field, points, points + 1.0, torch.zeros(10).double()) == 0
    assert consistency.view_loss(field, points, points, torch.ones(10).double()) == 0

import math

import pytest
import torch

from ddf.fields import activations

NAMES = list(activations.ACTIVATIONS)
POINTS = torch.tensor([-3.0, -0.4, -0.05, -1e-3, 1e-3, 0.02, 0.7, 5.0], dtype=torch.float64)  # off ReLU's corner


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("sharpness", [1.0, 20.0])
def test_derivatives_equal_autograd(name, sharpness):
    activation = activations.ACTIVATIONS[name]
    raw = POINTS.clone().requires_grad_()
    (slope,) = torch.autograd.grad(activation.value(raw, sharpness).sum(), raw, create_graph=True)
    assert (activation.slope(raw, sharpness) - slope).abs().max() <= 1e-8
    bend = torch.zeros_like(raw)
    if slope.requires_grad:
        (bend,) = torch.autograd.grad(slope.sum(), raw)
    assert (activation.bend(raw, sharpness) - bend).abs().max() <= 1e-8 * sharpness


@pytest.mark.parametrize("function", ["value", "slope", "bend"])
@pytest.mark.parametrize("name", ["softplus", "squareplus"])
def test_functions_pass_gradcheck(name, function):
    apply = getattr(activations.ACTIVATIONS[name], function)
    raw = torch.cat((POINTS, torch.zeros(1, dtype=torch.float64))).requires_grad_()
    assert torch.autograd.gradcheck(lambda values: apply(values, 5.0), (raw,))


@pytest.mark.parametrize("name", NAMES)
def test_values_are_relu_within_the_stated_distance(name):
    raw = torch.linspace(-3, 3, 601, dtype=torch.float64)
    gap = activations.ACTIVATIONS[name].value(raw, 50.0) - torch.relu(raw)
    widest = {"relu": 0.0, "softplus": math.log(2) / 50, "squareplus": 1 / 50}[name]
    assert gap.min() >= 0
    assert gap.max().item() == pytest.approx(widest, abs=1e-12)
    assert gap.argmax() == 300 or name == "relu"


def test_squareplus_keeps_value_and_gradient_far_below_zero_where_softplus_has_none():
    raw = torch.tensor([-2.0, -100.0, -1e4], requires_grad=True)
    exact = raw.detach().double()
    found, slopes = {}, {}
    for name in ("softplus", "squareplus"):
        found[name] = activations.ACTIVATIONS[name].value(raw, 100.0)
        (slopes[name],) = torch.autograd.grad(found[name].sum(), raw)
    assert bool((slopes["softplus"] == 0).all())
    truth = (exact + torch.sqrt(exact**2 + 4e-4)) / 2
    assert found["squareplus"][0].item() == pytest.approx(truth[0].item(), rel=1e-5)
    assert slopes["squareplus"].tolist() == pytest.approx([1e-4 / x**2 for x in (2.0, 100.0, 1e4)], rel=1e-3)
    same = activations.ACTIVATIONS["squareplus"].slope(raw, 100.0)
    torch.testing.assert_close(same, slopes["squareplus"], rtol=1e-5, atol=0)

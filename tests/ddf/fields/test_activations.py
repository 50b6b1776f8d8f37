import math

import pytest
import torch

from ddf.fields import siren

NAMES = list(siren.ACTIVATIONS)
POINTS = torch.tensor([-3.0, -0.4, -0.05, -1e-3, 1e-3, 0.02, 0.7, 5.0], dtype=torch.float64)  # off ReLU's corner


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("sharpness", [1.0, 20.0])
def test_derivatives_equal_autograd(name, sharpness):
    activation = siren.ACTIVATIONS[name]
    raw = POINTS.clone().requires_grad_()
    (slope,) = torch.autograd.grad(activation.value(raw, sharpness).sum(), raw)
    assert (activation.slope(raw, sharpness) - slope).abs().max() <= 1e-8


@pytest.mark.parametrize("function", ["value", "slope"])
def test_functions_pass_gradcheck(function):
    apply = getattr(siren.ACTIVATIONS["softplus"], function)
    raw = torch.cat((POINTS, torch.zeros(1, dtype=torch.float64))).requires_grad_()
    assert torch.autograd.gradcheck(lambda values: apply(values, 5.0), (raw,))


@pytest.mark.parametrize("name", NAMES)
def test_values_are_relu_within_the_stated_distance(name):
    raw = torch.linspace(-3, 3, 601, dtype=torch.float64)
    gap = siren.ACTIVATIONS[name].value(raw, 50.0) - torch.relu(raw)
    widest = {"relu": 0.0, "softplus": math.log(2) / 50}[name]
    assert gap.min() >= 0
    assert gap.max().item() == pytest.approx(widest, abs=1e-12)
    assert gap.argmax() == 300 or name == "relu"

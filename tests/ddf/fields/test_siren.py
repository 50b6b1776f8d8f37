"""Sine networks, their modulations and activations: written-out formulas, initial weights, slopes by autograd."""

import math

import pytest
import torch

from ddf.fields import siren


def test_network_is_the_formula():
    torch.manual_seed(0)
    network = siren.SineNetwork(2, siren.SineLayout((3, 4), 2.0, 5.0), 1).double()
    x = torch.randn(7, 2, dtype=torch.float64)
    modulations = [torch.full((1, 3), 0.5, dtype=torch.float64), torch.full((1, 4), 2.0, dtype=torch.float64)]
    first, second = network.layers
    hidden = 0.5 * torch.sin(2.0 * (x @ first.weight.T + first.bias))
    hidden = 2.0 * torch.sin(5.0 * (hidden @ second.weight.T + second.bias))
    expected = hidden @ network.head.weight.T + network.head.bias
    torch.testing.assert_close(network(x, modulations), expected, rtol=1e-12, atol=1e-12)


def test_initial_weights_fill_their_bounds():
    torch.manual_seed(0)
    network = siren.SineNetwork(6, siren.SineLayout((256, 256), 1.0, 4.0), 4)
    for layer, bound in ((network.layers[0], 1.0), (network.layers[1], math.sqrt(6 / 256) / 4)):
        largest = float(layer.weight.detach().abs().max())
        assert 0.98 * bound < largest <= bound


def test_modulator_chains_previous_modulation_and_latent():
    torch.manual_seed(0)
    modulator = siren.Modulator(3, (4, 5)).double()
    z = torch.randn(2, 3, dtype=torch.float64)
    first = torch.nn.functional.softplus(modulator.layers[0](z))
    second = torch.nn.functional.softplus(modulator.layers[1](torch.cat((first, z), dim=-1)))
    found = modulator(z)
    assert [tuple(m.shape) for m in found] == [(2, 1, 4), (2, 1, 5)]
    assert torch.equal(found[0][:, 0], first)
    assert torch.equal(found[1][:, 0], second)


def test_modulations_start_at_about_one():
    torch.manual_seed(0)
    for modulation in siren.Modulator(32, (64,) * 3)(torch.zeros(1, 32)):
        assert 0.5 < float(modulation.detach().mean()) < 1.6


POINTS = torch.tensor([-3.0, -0.4, -0.05, -1e-3, 1e-3, 0.02, 0.7, 5.0], dtype=torch.float64)  # off ReLU's corner


@pytest.mark.parametrize("name", siren.ACTIVATIONS)
@pytest.mark.parametrize("sharpness", [1.0, 20.0])
def test_slopes_of_activations_equal_autograd(name, sharpness):
    activation = siren.ACTIVATIONS[name]
    raw = POINTS.clone().requires_grad_()
    (slope,) = torch.autograd.grad(activation.value(raw, sharpness).sum(), raw)
    assert (activation.slope(raw, sharpness) - slope).abs().max() <= 1e-8


@pytest.mark.parametrize("name", siren.ACTIVATIONS)
def test_activations_are_relu_within_the_stated_distance(name):
    raw = torch.linspace(-3, 3, 601, dtype=torch.float64)
    gap = siren.ACTIVATIONS[name].value(raw, 50.0) - torch.relu(raw)
    widest = {"relu": 0.0, "softplus": math.log(2) / 50}[name]
    assert gap.min() >= 0
    assert gap.max().item() == pytest.approx(widest, abs=1e-12)
    assert gap.argmax() == 300 or name == "relu"

"""The explicit passes are the derivatives: autograd in float64 is the reference."""

import pytest
import torch

from ddf.fields import derivatives, siren

WIDTHS = (16, 16, 8)


def _network(dtype=torch.float64, omega_first=1.0, omega_hidden=1.0, seed=0):
    torch.manual_seed(seed)
    return siren.SineNetwork(6, siren.SineLayout(WIDTHS, omega_first, omega_hidden), 4).to(dtype)


def _modulations(shapes, dtype=torch.float64):
    torch.manual_seed(7)
    modulator = siren.Modulator(5, WIDTHS).to(dtype)
    return [m.detach() for m in modulator(torch.randn(shapes, 5, dtype=dtype))]


def _inputs(shapes, points, dtype=torch.float64):
    generator = torch.Generator().manual_seed(1)
    return torch.randn(shapes, points, 6, generator=generator, dtype=dtype)


@pytest.mark.parametrize("modulated", [False, True])
@pytest.mark.parametrize(("omega_first", "omega_hidden"), [(1.0, 1.0), (3.0, 30.0)])
@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-8), (torch.float32, 1e-4)])
def test_adjoint_and_tangent_equal_autograd(modulated, omega_first, omega_hidden, dtype, tolerance):
    network, modulations = _network(dtype, omega_first, omega_hidden), _modulations(2, dtype) if modulated else None
    inputs = _inputs(2, 9, dtype).requires_grad_()
    directions = torch.randn(2, 9, 3, generator=torch.Generator().manual_seed(2), dtype=dtype)
    trace = derivatives.trace(network, inputs, modulations)
    jacobian = torch.stack(
        [torch.autograd.grad(trace.outputs[..., i].sum(), inputs, retain_graph=True)[0][..., :3] for i in range(4)], -2
    )
    rates = derivatives.tangent(network, trace.slopes, directions)
    expected = (jacobian @ directions[..., None])[..., 0]
    assert (rates - expected).abs().max() <= tolerance * expected.abs().max()
    one_row = derivatives.tangent(network, trace.slopes, directions, slice(2, 3))
    assert (one_row - rates[..., 2:3]).abs().max() <= tolerance * expected.abs().max()
    for row in range(4):
        cotangents = torch.nn.functional.one_hot(torch.full((2, 9), row), 4).to(dtype)
        gradient = derivatives.adjoint(network, trace.slopes, cotangents)
        assert (gradient - jacobian[..., row, :]).abs().max() <= tolerance * jacobian.abs().max()


def test_trace_outputs_equal_forward():
    network, modulations, inputs = _network(), _modulations(3), _inputs(3, 11)
    trace = derivatives.trace(network, inputs, modulations)
    torch.testing.assert_close(trace.outputs, network(inputs, modulations), rtol=1e-12, atol=1e-12)
    assert [tuple(s.shape) for s in trace.slopes] == [(3, 11, 16), (3, 11, 16), (3, 11, 8)]


@pytest.mark.parametrize("which", ["adjoint", "tangent"])
def test_parameter_gradient_of_a_derivative_equals_double_backward(which):
    network, modulations = _network(), _modulations(2)
    inputs = _inputs(2, 5).requires_grad_()
    target = torch.randn(2, 5, 3, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    (gradient,) = torch.autograd.grad(network(inputs, modulations)[..., 1].sum(), inputs, create_graph=True)
    reference = (gradient[..., :3] * target).sum().square()
    expected = torch.autograd.grad(reference, list(network.parameters()), allow_unused=True)

    trace = derivatives.trace(network, inputs.detach(), modulations)
    if which == "adjoint":
        row = torch.tensor([0.0, 1.0], dtype=torch.float64).expand(2, 5, 2)
        value = (derivatives.adjoint(network, trace.slopes, row) * target).sum().square()
    else:
        value = derivatives.tangent(network, trace.slopes, target, slice(1, 2)).sum().square()
    found = torch.autograd.grad(value, list(network.parameters()), allow_unused=True)
    largest = max(float(e.abs().max()) for e in expected if e is not None)
    assert largest > 0
    for mine, theirs in zip(found, expected, strict=True):
        mine = torch.zeros(()) if mine is None else mine
        theirs = torch.zeros(()) if theirs is None else theirs
        assert (mine - theirs).abs().max() <= 1e-8 * largest

"""The explicit passes are the derivatives, first and second: autograd in float64 and closed forms are the reference."""

import pytest
import torch
from torch.nn import functional

from ddf.fields import derivatives, pddf, siren

WIDTHS = (16, 16, 8)


def _modulations(shapes, dtype=torch.float64):
    torch.manual_seed(7)
    modulator = siren.Modulator(5, WIDTHS).to(dtype)
    return [m.detach() for m in modulator(torch.randn(shapes, 5, dtype=dtype))]


def _random(*shape, seed=1, dtype=torch.float64):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=dtype)


@pytest.mark.parametrize("modulated", [False, True])
@pytest.mark.parametrize(("omega_first", "omega_hidden"), [(1.0, 1.0), (3.0, 30.0)])
@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-8), (torch.float32, 1e-4)])
def test_adjoint_and_tangent_equal_autograd(modulated, omega_first, omega_hidden, dtype, tolerance):
    torch.manual_seed(0)
    network = siren.SineNetwork(6, siren.SineLayout(WIDTHS, omega_first, omega_hidden), 4).to(dtype)
    modulations = _modulations(2, dtype) if modulated else None
    inputs = _random(2, 9, 6, dtype=dtype).requires_grad_()
    directions = _random(2, 9, 3, seed=2, dtype=dtype)
    trace = derivatives.trace(network, inputs, modulations)
    jacobian = torch.stack(
        [torch.autograd.grad(trace.outputs[..., i].sum(), inputs, retain_graph=True)[0][..., :3] for i in range(4)], -2
    )
    states = derivatives.tangent_states(network, trace.slopes, directions)
    rates = network.head(states[-1] * trace.slopes[-1]) - network.head.bias
    expected = (jacobian @ directions[..., None])[..., 0]
    assert (rates - expected).abs().max() <= tolerance * expected.abs().max()
    for row in range(4):
        cotangents = torch.nn.functional.one_hot(torch.full((2, 9), row), 4).to(dtype)
        gradient = derivatives.adjoint(network, trace.slopes, cotangents)
        assert (gradient - jacobian[..., row, :]).abs().max() <= tolerance * jacobian.abs().max()


def _field(activation: pddf.DepthActivation = "softplus"):
    torch.manual_seed(3)
    return pddf.PDDF(pddf.PDDFConfig(WIDTHS, 3.0, 2.0, activation, 10.0)).double()


def _autograd_hessian(field, p, v, modulations):
    """Of d_{i*}, written out."""
    p = p.clone().requires_grad_()
    raw = field(p, v, modulations)
    depth = torch.where(raw[..., 2] >= 0, field.depths(raw)[..., 0], field.depths(raw)[..., 1])
    (gradient,) = torch.autograd.grad(depth.sum(), p, create_graph=True)
    rows = [torch.autograd.grad(gradient[..., i].sum(), p, retain_graph=True)[0] for i in range(3)]
    return gradient.detach(), torch.stack(rows, -2)


@pytest.mark.parametrize("modulated", [False, True])
@pytest.mark.parametrize("activation", ["softplus", "relu"])
def test_curvatures_equal_property_v_from_autograd(modulated, activation):
    field, modulations = _field(activation), _modulations(2) if modulated else None
    p, v = _random(2, 40, 3), functional.normalize(_random(2, 40, 3, seed=2), dim=-1)
    found = derivatives.Surface(field, p, v, modulations)
    gradient, hessian = _autograd_hessian(field, p, v, modulations)
    n = functional.normalize(gradient, dim=-1)
    n = torch.where((n * v).sum(-1, keepdim=True) > 0, -n, n)
    project = torch.eye(3, dtype=torch.float64) - n[..., :, None] * n[..., None, :]
    form = project @ hessian @ project * (n * v).sum(-1)[..., None, None]  # II on the tangent plane, 0 along n
    mean = form.diagonal(dim1=-2, dim2=-1).sum(-1)
    gaussian = (mean.square() - (form @ form).diagonal(dim1=-2, dim2=-1).sum(-1)) / 2
    assert (found.normals - n).abs().max() <= 1e-10
    assert (found.mean - mean).abs().max() <= 1e-8 * mean.abs().max()
    assert (found.gaussian - gaussian).abs().max() <= 1e-8 * gaussian.abs().max()


def test_tangent_basis_is_orthonormal_and_finite_at_zero():
    n = torch.cat((functional.normalize(_random(50, 3), dim=-1), torch.eye(3).double(), -torch.eye(3).double()))
    frame = torch.stack((*derivatives.tangent_basis(n), n), dim=-1)
    torch.testing.assert_close(frame.transpose(-1, -2) @ frame, torch.eye(3).double().expand(56, 3, 3))
    assert all(bool(torch.isfinite(t).all()) for t in derivatives.tangent_basis(torch.zeros(2, 3)))


def test_parameters_receive_the_gradient_of_a_curvature():
    field = _field()
    p, v = _random(6, 3), functional.normalize(_random(6, 3, seed=2), dim=-1)
    found = derivatives.Surface(field, p, v)
    (found.mean.square().sum() + found.gaussian.square().sum()).backward()
    weight = field.network.layers[1].weight.grad
    assert weight is not None
    assert bool(torch.isfinite(weight).all()) and float(weight.abs().max()) > 0

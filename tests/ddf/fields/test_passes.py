"""The written-out reverse is the gradient: autograd in float64 through one-derivative-per-call is the reference."""

import pytest
import torch

from ddf.fields import passes, siren

WIDTHS, SPAN, COUNT = (16, 12, 16, 8), slice(1, 4), 5  # of 7 points: adjoint on three, tangents on five


def _random(*shape, seed, dtype=torch.float64):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64).to(dtype)


def _network(dtype=torch.float64):
    torch.manual_seed(0)
    return siren.SineNetwork(6, siren.SineLayout(WIDTHS, 3.0, 2.0), 4).to(dtype)


def _modulations(dtype=torch.float64):
    return [0.5 + _random(2, 1, width, seed=9).square().to(dtype) for width in WIDTHS]


def _given(dtype=torch.float64):
    inputs, directions = _random(2, 7, 6, seed=1, dtype=dtype), _random(2, COUNT, 3, seed=2, dtype=dtype)
    return inputs, directions, _random(2, 3, 2, seed=3, dtype=dtype)


def _by_autograd(network, modulations):
    """Outputs, rates and gradient by autograd, with graph."""
    inputs, directions, cotangents = _given()
    inputs = inputs.requires_grad_()
    outputs = network(inputs, modulations)
    jacobian = torch.stack(
        [torch.autograd.grad(outputs[..., i].sum(), inputs, create_graph=True)[0][..., :3] for i in range(4)], -2
    )
    rates = (jacobian[:, :COUNT] @ directions[..., None])[..., 0]
    return outputs, rates, (cotangents[..., None] * jacobian[:, SPAN, :2]).sum(-2)


def _sensitivities(dtype=torch.float64):
    shapes = ((2, 7, 4), (2, COUNT, 4), (2, 3, 3))
    return tuple(_random(*shape, seed=4 + i, dtype=dtype) for i, shape in enumerate(shapes))


def _by_passes(network, modulations, dtype=torch.float64):
    parameters = passes.Parameters(network)
    inputs, directions, cotangents = _given(dtype)
    block = passes.Block(parameters, inputs, directions, modulations)
    gradient = block.adjoint(SPAN, cotangents)
    values = [each.clone() for each in (block.outputs, block.rates, gradient)]
    found = block.reverse(*_sensitivities(dtype))
    return values, parameters.gradients(), found


@pytest.mark.parametrize("modulated", [False, True])
@pytest.mark.parametrize(("dtype", "tolerance"), [(torch.float64, 1e-8), (torch.float32, 1e-4)])
def test_passes_and_their_reverse_equal_autograd(modulated, dtype, tolerance):
    network, modulations = _network(), _modulations() if modulated else None
    leaves = [each.requires_grad_() for each in modulations or []]
    expected = _by_autograd(network, modulations)
    truth = torch.autograd.grad(expected, [*network.parameters(), *leaves], _sensitivities())
    lower = _modulations(dtype) if modulated else None
    values, gradients, found = _by_passes(_network(dtype), lower, dtype)
    for mine, theirs in zip(values, expected, strict=True):
        assert mine.dtype == dtype
        assert (mine - theirs).abs().max() <= tolerance * theirs.abs().max()
    assert len(found) == len(leaves)
    for mine, theirs in zip([*gradients, *found], truth, strict=True):
        assert mine.shape == theirs.shape
        assert theirs.abs().max() > 0
        assert (mine - theirs).abs().max() <= tolerance * theirs.abs().max()


def test_sums_add_up_over_blocks_and_memory_is_used_again():
    network, held = _network(), []
    once = _by_passes(network, None)[1]
    parameters = passes.Parameters(network)
    inputs, directions, cotangents = _given()
    nothing = [torch.zeros(2, *shape, dtype=torch.float64) for shape in ((4, 4), (2, 4), (0, 3))]
    for points, count, span, sensitivities in ((7, COUNT, SPAN, _sensitivities()), (4, 2, slice(0, 0), nothing)) * 2:
        block = passes.Block(parameters, inputs[:, :points], directions[:, :count], None)
        block.adjoint(span, cotangents[:, : span.stop - span.start])
        block.reverse(*sensitivities)
        held.append([buffer.data_ptr() for buffer in parameters.workspace.buffers])
    assert held[0] == held[1] == held[2] == held[3]
    for twice, single in zip(parameters.gradients(), once, strict=True):
        torch.testing.assert_close(twice, 2 * single, rtol=1e-10, atol=1e-12)


def test_a_modulation_of_zero_gives_finite_gradients():
    modulations = _modulations()
    modulations[1][:, :, 3] = 0
    _, gradients, found = _by_passes(_network(), modulations)
    assert all(bool(torch.isfinite(each).all()) for each in (*gradients, *found))
    assert bool((found[1][:, :, 3] == 0).all())

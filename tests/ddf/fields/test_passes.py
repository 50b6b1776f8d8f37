"""Sums of the written-out reverse, over blocks; that it is the gradient is told by test_losses."""

import torch

from ddf.fields import passes, siren

WIDTHS, SPAN, COUNT = (16, 12, 16, 8), slice(1, 4), 5  # of 7 points: adjoint on three, tangents on five


def _random(*shape, seed):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def _parameters():
    torch.manual_seed(0)
    return passes.Parameters(siren.SineNetwork(6, siren.SineLayout(WIDTHS, 3.0, 2.0), 4).double())


INPUTS, DIRECTIONS, COTANGENTS = _random(2, 7, 6, seed=1), _random(2, COUNT, 3, seed=2), _random(2, 3, 2, seed=3)
SENSITIVITIES = [_random(*shape, seed=4) for shape in ((2, 7, 4), (2, COUNT, 4), (2, 3, 3))]


def test_sums_add_up_over_blocks_and_memory_is_used_again():
    once, parameters, held = _parameters(), _parameters(), []
    block = passes.Block(once, INPUTS, DIRECTIONS, None)
    block.adjoint(SPAN, COTANGENTS)
    block.reverse(*SENSITIVITIES)
    nothing = [torch.zeros(2, *shape, dtype=torch.float64) for shape in ((4, 4), (2, 4), (0, 3))]
    for points, count, span, sensitivities in ((7, COUNT, SPAN, SENSITIVITIES), (4, 2, slice(0, 0), nothing)) * 2:
        block = passes.Block(parameters, INPUTS[:, :points], DIRECTIONS[:, :count], None)
        block.adjoint(span, COTANGENTS[:, : span.stop - span.start])
        block.reverse(*sensitivities)
        held.append([buffer.data_ptr() for buffer in parameters.workspace.buffers])
    assert held[0] == held[1] == held[2] == held[3]
    for twice, single in zip(parameters.gradients(), once.gradients(), strict=True):
        torch.testing.assert_close(twice, 2 * single, rtol=1e-10, atol=1e-12)


def test_a_modulation_of_zero_gives_finite_gradients():
    parameters, modulations = _parameters(), [0.5 + _random(2, 1, width, seed=9).square() for width in WIDTHS]
    modulations[1][:, :, 3] = 0
    block = passes.Block(parameters, INPUTS, DIRECTIONS, modulations)
    block.adjoint(SPAN, COTANGENTS)
    found = block.reverse(*SENSITIVITIES)
    assert all(bool(torch.isfinite(each).all()) for each in (*parameters.gradients(), *found))
    assert bool((found[1][:, :, 3] == 0).all())

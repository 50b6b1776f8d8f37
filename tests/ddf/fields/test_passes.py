"""The written-out reverse is the gradient: autograd in float64 is the reference; compiled passes give the same."""

import logging
import os
import subprocess
import sys
from pathlib import Path

import _models
import pytest
import torch

from ddf.fields import losses, passes, pddf, siren

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


ABSENT = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
COUNTS = {"E": 3, "U": 6, "A": 6, "B": 4, "S": 4, "T": 4, "O": 4, "A+": 5}


def gradients_of(field, batch, modulations):
    """Loss and its terms, and the gradient in modulations and parameters."""
    given = [each.clone().requires_grad_() for each in modulations]
    field.zero_grad()
    loss, terms = losses.shape_loss(field, batch, given, _models.WEIGHTS)
    loss.backward()
    found = [each.grad for each in (*given, *field.parameters())]
    return torch.stack([loss.detach(), *terms.values()]), torch.cat([each.flatten() for each in found])


def conditional_field():
    """A field, a batch and modulations of four shapes."""
    torch.manual_seed(0)
    config = pddf.PDDFConfig((24, 16), 2.0, 1.5, "softplus", 20.0)
    field, batch = pddf.PDDF(config), _models.batch(COUNTS, 4, torch.float32)
    return field, batch, [torch.rand(4, 1, width) + 0.5 for width in config.hidden]


COMPILED = """
import sys
import torch
from ddf.fields import losses, passes
import test_passes as here

(device,) = sys.argv[1:]
field, batch, modulations = here.conditional_field()
field, batch = field.to(device), batch.to(torch.device(device))
given = field, batch, [each.to(device) for each in modulations]
losses._block_points = lambda field, batch: 2 * batch.visible.shape[1]  # two blocks
passes.compiles = lambda device: False
values, gradients = here.gradients_of(*given)
passes.compiles = lambda device: True
own_values, own = here.gradients_of(*given)
apart = [((own_values - values) / values).abs().max(), (own - gradients).norm() / gradients.norm()]
assert not torch.equal(own, gradients)
leaf, found = [each.requires_grad_() for each in given[2]], []
for training in (False, True):  # trainings alone compile
    raw = passes.compiled_raw(field.train(training), batch.positions, batch.directions, leaf)
    slopes = torch.autograd.grad(raw.square().sum(), [*leaf, *field.parameters()])
    found.append(torch.cat([each.flatten() for each in (raw, *slopes)]))
apart.append((found[1] - found[0]).norm() / found[0].norm())
assert not passes._refused, passes._refused
print(*map(float, apart))
"""


@pytest.mark.timeout(1800)  # of a busy machine
@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda", marks=(pytest.mark.gpu, ABSENT))])
@pytest.mark.slow
def test_compiled_loss_and_gradients_are_those_of_plain_passes(device):
    """In a process of its own: the compiler cannot read what checks the shapes of arguments in tests."""
    here = Path(__file__).resolve()
    paths = [str(here.parents[2]), str(here.parent), os.environ.get("PYTHONPATH", "")]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-c", COMPILED, device]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-3000:]
    assert max(map(float, done.stdout.split())) < 1e-4


def test_where_nothing_compiles_passes_are_plain_and_one_line_says_so(monkeypatch, caplog):
    from torch._dynamo import exc  # slow to import

    given = conditional_field()
    truth = gradients_of(*given)

    def refuse(*_):
        raise exc.Unsupported("no compiler\nfor this")

    monkeypatch.setattr(passes, "_compiled", lambda plain: refuse)
    monkeypatch.setattr(passes, "_refused", [])
    monkeypatch.setattr(passes, "compiles", lambda device: not passes._refused)
    with caplog.at_level(logging.WARNING):
        found = gradients_of(*given)
    assert all(torch.equal(own, other) for own, other in zip(truth, found, strict=True))
    (record,) = caplog.records
    assert "the loss is not compiled, so steps take longer" in record.message and "\n" not in record.message


def test_a_cpu_compiles_nothing_and_a_gpu_does():
    assert not passes.compiles(torch.device("cpu")) and passes.compiles(torch.device("cuda"))


def test_blocks_of_a_gpu_are_of_one_size(monkeypatch):
    field, batch = pddf.PDDF(pddf.PDDFConfig((24, 16), 2.0, 1.5, "softplus", 20.0)).to("meta"), _models.batch(COUNTS, 7)
    count = sum(COUNTS.values())
    for room, wanted in ((3 * count, 3 * count), (4 * count, 4 * count), (6 * count, 4 * count), (20, 20)):
        monkeypatch.setattr(losses, "block_values", lambda device, room=room: 24 * room)
        assert losses._block_points(field, batch) == wanted

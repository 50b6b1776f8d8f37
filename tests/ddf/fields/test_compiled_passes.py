"""Compiled passes give the loss and the gradients of plain ones, by fewer kernels."""

import logging
import os
import subprocess
import sys
from pathlib import Path

import _models
import pytest
import torch

from ddf.fields import losses, passes, pddf

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
    return (
        pddf.PDDF(config),
        _models.batch(COUNTS, 4, torch.float32),
        [torch.rand(4, 1, width) + 0.5 for width in config.hidden],
    )


COMPILED = """
import sys
import torch
from ddf.fields import losses, passes
import test_compiled_passes as here

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

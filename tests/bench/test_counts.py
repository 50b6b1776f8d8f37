"""What a step asks a GPU for, counted without one."""

import dataclasses
from pathlib import Path
from unittest import mock

import pytest
import torch

from bench.gpu import counts, sizes
from ddf.core import arrays

ROOT = Path(__file__).resolve().parents[2]
MASK_PIXELS = 20  # the paper evaluates all


@pytest.fixture(autouse=True)
def _root(monkeypatch):
    monkeypatch.chdir(ROOT)  # where the configs are


def test_launches_waits_and_copies_are_told_apart():
    def work():
        values = torch.rand(4, 3).to(counts.DEVICE)  # sent
        total = (values @ values.T).sum()  # two, beside a view
        if float(total) > 0:  # a wait
            values = values[values > 0]  # two, and a wait
        return values.cpu()  # fetched

    with counts.faked():
        found = counts.count(work)
    assert (found.sent, found.fetched, found.launches) == (1, 1, 4)
    assert found.waits == {"_local_scalar_dense": 1, "index by a mask": 1}
    assert found.flops == 2 * 4 * 3 * 4 and found.names["mm"] == 1
    assert found.bytes > 4 * (2 * 12 + 16)


@pytest.mark.parametrize("model", ["ddf", "pcsiren", "casting"])
def test_a_step_waits_for_nothing_and_sends_by_pinned_memory_alone(model):
    how, sent = sizes.tiny(), []
    section = how.sections["pcsiren" if model == "pcsiren" else "ddf"]
    if model != "pcsiren":
        section = dataclasses.replace(section, mask_pixels=MASK_PIXELS)
    if model == "casting":
        section = dataclasses.replace(section, samples="fresh", proposals=how.proposals)

    def send(values, device):
        if device.type == counts.DEVICE and not getattr(values, "is_meta", False):
            sent.append(values)
        return _send(values, device)

    _send = arrays.send
    with mock.patch.object(arrays, "send", send):
        found = counts.step_counts(how.train, section)
    assert found.waits == {} and found.fetched == 0 and found.launches > 100
    assert 2 * found.sent == len(sent)  # of two steps, of which one is counted: all that is sent goes this way
    assert found.sent <= (12 if model == "casting" else 9)

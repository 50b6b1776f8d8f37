"""What bfloat16 costs a gradient: rounding is small; most of the error is of points that decide otherwise.

Which component is the heavier one, to which side a normal faces and the signs of the absolute values in L_n and L_T are
decisions: near the edge of one, the least rounding turns the whole gradient of a point. A batch of noise has many such
points. With the decisions of float32 what is left is rounding.
"""

import contextlib
import dataclasses
from unittest import mock

import _models
import numpy as np
import pytest
import torch
from torch.nn import functional

from bench.gpu import trial
from ddf.data.samples import sample_types
from ddf.fields import derivatives, losses, passes, pddf

HIDDEN = (256, 256, 128, 128)
COUNTS = dict.fromkeys(sample_types.ORDER, 60)


class Decisions:
    """Those of one run, in the order in which they are made, which further runs then keep."""

    def __init__(self):
        self.made, self.next = [], 0

    def keep(self, decision):
        if self.next == len(self.made):
            self.made.append(decision.detach())
        self.next += 1
        return self.made[self.next - 1]

    @contextlib.contextmanager
    def kept(self):
        """The loss with kept decisions, from the first one on."""

        def heavier(raw):
            first = first_is_heavier(raw).to(raw.dtype)
            return torch.stack((first, 1 - first), dim=-1)

        def first_is_heavier(raw):
            return self.keep(raw[..., pddf.WEIGHT_ROW] >= 0)

        def magnitude(values):
            return values * self.keep(values.sign())

        self.next = 0
        with (
            mock.patch.object(losses, "heavier_rows", heavier),
            mock.patch.object(pddf, "first_is_heavier", first_is_heavier),
            mock.patch.object(derivatives, "normals", lambda gradient, _: functional.normalize(gradient, dim=-1)),
            mock.patch.object(losses, "normal_loss", lambda own, truth, seen: -seen * magnitude((own * truth).sum(-1))),
            mock.patch.object(
                losses, "transition_loss", lambda rate, speed: torch.relu(speed - magnitude(rate)).square()
            ),
        ):
            yield


@pytest.fixture
def gradient(monkeypatch):
    """Of the loss in a field's parameters, by the type of its products."""
    monkeypatch.setattr(passes, "has_bfloat16", lambda device: True)
    monkeypatch.setattr(trial, "STORED", 300)
    torch.manual_seed(0)
    field = pddf.PDDF(pddf.PDDFConfig(HIDDEN, 1.0, 1.0, "softplus", 20.0))
    batch = trial.random_samples(2).draw(np.arange(2), COUNTS, np.random.default_rng(0))

    def of(matmul, weights=_models.WEIGHTS):
        field.zero_grad()
        losses.shape_loss(field, batch, None, weights, matmul)[0].backward()
        return torch.cat([weight.grad.flatten() for weight in field.parameters() if weight.grad is not None])

    return of


def _apart(own, truth):
    relative = float((own - truth).norm() / truth.norm())
    return relative, float(functional.cosine_similarity(own, truth, dim=0))


def test_with_the_decisions_of_float32_a_gradient_in_bfloat16_differs_by_rounding(gradient):
    decisions = Decisions()
    with decisions.kept():
        exact = gradient("float32")
    assert len(decisions.made) >= 4
    with decisions.kept():
        relative, cosine = _apart(gradient("bfloat16"), exact)
    assert cosine >= 0.999 and 1e-3 < relative < 0.045
    free, _ = _apart(gradient("bfloat16"), gradient("float32"))
    assert free > 1.3 * relative


def test_terms_without_decisions_need_none_kept(gradient):
    weights = dataclasses.replace(_models.WEIGHTS, depth=0.0, normals=0.0, transition=0.0)
    relative, cosine = _apart(gradient("bfloat16", weights), gradient("float32", weights))
    assert cosine >= 0.999 and relative < 0.02

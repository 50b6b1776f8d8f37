"""Consistency losses of a fit: off they change nothing, on they are added and reach the weights."""

import dataclasses

import numpy as np
import pytest
import torch
from _shapes import icosphere
from _support import assert_close
from _tiny_fits import TINY

from ddf.core import checks, storage
from ddf.fields import consistency, pddf, shape_field
from ddf.fit import fit_settings, fitting, shape_samples


@pytest.fixture(scope="module")
def drawn():
    torch.manual_seed(0)
    return pddf.PDDF(TINY.field), shape_samples.draw_samples(icosphere(2), TINY, TINY.samples, "train")[0]


@pytest.mark.parametrize("name, term", [("view", "view_inequality"), ("gradient", "gradient_consistency")])
def test_a_weight_adds_its_term_and_its_gradient(name, term, drawn):
    field, samples = drawn
    settings = dataclasses.replace(TINY, consistency=fit_settings.ConsistencyWeights(**{name: 2.0}))
    plain, terms = fitting.step_loss(field, samples, TINY, 0)
    total, found = fitting.step_loss(field, samples, settings, 0)
    assert term not in terms and float(found[term]) > 0
    assert float((total - plain).detach()) == pytest.approx(2 * float(found[term]), rel=1e-4)
    parts = (torch.autograd.grad(value, list(field.parameters()))[2] for value in (total, plain))
    assert np.subtract(*(part.numpy() for part in parts)).any()


def test_a_hit_is_looked_at_from_the_sample_before(drawn):
    field, samples = drawn
    settings = dataclasses.replace(TINY, consistency=fit_settings.ConsistencyWeights(view=1.0))
    found = fitting.step_loss(field, samples, settings, 0)[1]["view_inequality"]
    batch = samples.batch(samples.batch_counts(TINY.batch), np.random.default_rng((TINY.loop.seed, 0)))
    span = batch.span("U", "U")
    starts, visible = batch.positions[:, span], batch.visible[:, span]
    hits = starts + batch.depth[:, span, None] * batch.directions[:, span]
    before = torch.stack([starts[:, i - 1] for i in range(starts.shape[1])], dim=1)
    assert_close(found, consistency.view_loss(field, hits, before, visible).detach())


def test_a_fit_goes_on_from_the_weights_of_another(tmp_path):
    mesh, still = icosphere(2), dataclasses.replace(TINY.loop, learning_rate=1e-9, warmup_steps=0, muon=None)
    fitting.fit(mesh, TINY, tmp_path / "first")
    first = shape_field.load(tmp_path / "first")
    settings = dataclasses.replace(TINY, steps=1, loop=still)
    for name, begin in (("further", first), ("anew", None)):
        fitting.fit(mesh, settings, tmp_path / name, begin=begin)
    plans = [storage.read_json(tmp_path / name / fitting.PLAN)["fingerprint"] for name in ("further", "anew")]
    further, anew = (shape_field.load(tmp_path / name).field.network.head.weight for name in ("further", "anew"))
    assert_close(further, first.field.network.head.weight, atol=1e-6)
    assert (anew - further).abs().max() > 1e-3
    assert plans[0] != plans[1]


def test_weights_below_zero_are_named():
    with pytest.raises(checks.InputError, match=r"view must be >= 0; got -1"):
        fit_settings.ConsistencyWeights(view=-1.0)

"""Consistency losses of a fit: off they change nothing, on they are added and reach the weights."""

import dataclasses

import numpy as np
import pytest
import torch
from _shapes import icosphere
from _tiny_fits import TINY

from ddf.core import checks
from ddf.fields import pddf
from ddf.shape import fit_settings, fitting, shape_samples


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


def test_weights_below_zero_are_named():
    with pytest.raises(checks.InputError, match=r"fit\.consistency\.view must be >= 0 and finite; got -1"):
        fit_settings.ConsistencyWeights(view=-1.0)

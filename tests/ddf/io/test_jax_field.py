"""A field in JAX: the values of the field itself, under jit, vmap and grad, and a shift found again by its gradient."""

import numpy as np
import pytest

import ddf
from ddf.core import checks
from ddf.io import jax_field


def test_without_jax_one_line_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "jax", None)
    with pytest.raises(checks.InputError, match="this needs jax: pip install jax"):
        jax_field.load("rabbit")


def _rays(count=400):
    """Towards the middle half of the rabbit's box, from about it; one of them misses it."""
    lower, upper = (np.asarray(corner) for corner in ddf.load("rabbit").box)
    rng, size = np.random.default_rng(0), np.linalg.norm(upper - lower)
    starts = rng.normal(size=(count, 3))
    starts = (lower + upper) / 2 + size * starts / np.linalg.norm(starts, axis=1, keepdims=True)
    along = (lower + upper) / 2 + (upper - lower) * rng.uniform(-0.25, 0.25, (count, 3)) - starts
    along[0] *= -1
    return starts.astype(np.float32), (along / np.linalg.norm(along, axis=1, keepdims=True)).astype(np.float32), size


def test_values_are_those_of_the_field_under_jit_and_vmap():
    jax = pytest.importorskip("jax")
    positions, directions, size = _rays()
    parameters, field = jax_field.load("rabbit")
    truth = ddf.load("rabbit").query(positions, directions)
    for asked in (jax.jit(field), jax.vmap(field, (None, 0, 0))):
        depth, visibility = asked(parameters, positions, directions)
        np.testing.assert_allclose(visibility, truth["visibility"], atol=2e-3)
        seen = np.isfinite(truth["depth"])
        assert 0.3 < seen.mean() < 1 and visibility[0] == 0
        np.testing.assert_allclose(np.asarray(depth)[seen], truth["depth"][seen], atol=float(2e-3 * size))


def test_gradients_are_finite_and_find_a_shift_again():
    jax = pytest.importorskip("jax")
    positions, directions, size = _rays()
    parameters, field = jax_field.load("rabbit")
    true = np.array([0.03, -0.02, 0.025], np.float32) * size
    depth, visibility = field(parameters, positions - true, directions)
    sure = visibility > 0.9

    def loss(shift):
        return (sure * abs(field(parameters, positions - shift, directions)[0] - depth)).mean() / size

    descend, shift = jax.jit(jax.grad(loss)), jax.numpy.zeros(3)
    for step in range(200):
        slope = descend(shift)
        assert np.isfinite(slope).all()
        shift -= 0.005 * size * 0.98**step * slope / (jax.numpy.linalg.norm(slope) + 1e-9)
    assert np.linalg.norm(shift - true) < 0.15 * np.linalg.norm(true)

"""`ddf.jax`: its answers are those of `ddf.torch`, under JAX's transformations; its gradients those of differences."""

import _models
import numpy as np
import pytest
import torch
from _shapes import icosphere, towards

import ddf
from ddf.core import checks
from ddf.fields import shape_field
from ddf.geometry import transforms

jax = pytest.importorskip("jax", reason="`make test-jax` brings JAX")
jax.config.update("jax_enable_x64", True)
jnp = jax.numpy
test_util = pytest.importorskip("jax.test_util")
ddf_jax = pytest.importorskip("ddf.jax")

POSE = np.array([[0.0, 1.5, 0, 0.1], [0, 0, 1.5, -0.2], [1.5, 0, 0, 0.1], [0, 0, 0, 1]])


def _rays(count: int, spread: float):
    return towards(count, 3, spread)


def _shape(name: str):
    return ddf.load("rabbit-network") if name == "network" else ddf.fit(icosphere(3), tolerance=1e-3)


def _agree(found, expected, tolerance=1e-9):
    for own, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(own, other.detach().double().numpy(), rtol=0, atol=tolerance)


@pytest.mark.parametrize(("name", "soft"), [("network", None), ("patches", 0.0), ("patches", None)])
@pytest.mark.parametrize(("kind", "tolerance"), [("float64", 2e-8), ("float32", 2e-3)])
def test_answers_are_those_of_torch_for_any_batch_shape_compiled_and_mapped(name, soft, kind, tolerance):
    shape, (starts, ways) = _shape(name), _rays(60, 1.2)
    expected = ddf.torch.Field(shape, soft).double()(*map(torch.from_numpy, (starts, ways, POSE)))
    assert 5 < expected.depth.isfinite().sum() < 60
    parameters, ask = ddf_jax.field(shape, soft)
    starts, ways = starts.astype(kind), ways.astype(kind)
    found = jax.jit(ask)(parameters, starts.reshape(3, 4, 5, 3), ways.reshape(3, 4, 5, 3), POSE.astype(kind))
    assert found.depth.shape == (3, 4, 5) and found.normals.dtype == kind
    _agree([each.reshape(60, *each.shape[3:]) for each in found], expected, tolerance)
    mapped = jax.vmap(lambda p, v: ask(parameters, p, v, POSE.astype(kind)))(starts, ways)
    _agree(mapped, expected, tolerance)
    assert ask(parameters, starts[:9, None], ways[:9]).depth.shape == (9, 9)
    assert ask(parameters, starts[0], ways[0]).normals.shape == (3,)


def test_a_latent_gives_the_shapes_of_a_model_with_gradients_of_differences():
    starts, ways = _rays(5, 0.2)
    latent, (parameters, ask) = np.array([0.3, -0.5, 0.2]), ddf_jax.of_model("chair")
    module = ddf.torch.Field.of_model("chair").double()
    expected = module(*map(torch.from_numpy, (starts, ways)), latent=torch.from_numpy(latent))
    _agree(ask(parameters, starts, ways, latent=latent), expected)
    _agree(ask(parameters, starts, ways), module(*map(torch.from_numpy, (starts, ways))))
    for shape, given in ((parameters, np.zeros((1, 3))), ({}, latent)):
        with pytest.raises(checks.InputError, match="latent: none of one shape"):
            ask(shape, starts, ways, latent=given)
    said = jax.jit(lambda u: ask(parameters, starts, ways, latent=u)[:4])
    test_util.check_grads(said, (latent,), 1, modes=("rev",), atol=1e-6, rtol=1e-6, eps=1e-5)


@pytest.mark.parametrize("name", ["network", "patches"])
def test_gradients_first_and_second_are_differences(name):
    starts, ways = _rays(6, 0.3)
    if name == "network":
        side = np.array([1.0, 0.7, 0.8])
        shape = shape_field.ShapeField(_models.field(), -side, side, transforms.Similarity(0.5), {})
    else:
        shape = _shape(name)
    parameters, ask = ddf_jax.field(shape, 0.0)
    assert np.isfinite(ask(parameters, starts, ways).depth).all()

    @jax.jit
    def said(p, v, rows):
        return ask(parameters, p, v, jnp.concatenate([rows, POSE[3:]]))[:4]

    test_util.check_grads(said, (starts, ways, np.eye(4)[:3]), 2, modes=("rev",), atol=1e-6, rtol=1e-6, eps=1e-5)


def test_soft_edges_have_the_gradients_of_torch_mapped_over_positions_alone():
    shape, (starts, ways) = _shape("patches"), _rays(60, 1.5)
    given = [torch.from_numpy(each).requires_grad_() for each in (starts, ways)]
    found = ddf.torch.Field(shape, 0.2)(*given)
    torch.stack((found.visibility, (found.weights * found.depths).sum(-1))).sum().backward()
    parameters, ask = ddf_jax.field(shape, 0.2)

    def said(p, v):
        found = ask(parameters, p, v)
        return found.visibility + (found.weights * found.depths).sum(-1)

    slopes = jax.jit(jax.vmap(jax.grad(said, (0, 1))))(starts, ways)
    for own, each in zip(slopes, given, strict=True):
        np.testing.assert_allclose(own, np.asarray(each.grad), rtol=0, atol=1e-7)
        assert (np.abs(own).max(-1) > 0).sum() > 20
    alone = jax.vmap(lambda p: ask(parameters, p, ways[0]).visibility)(starts)
    np.testing.assert_array_equal(alone, ask(parameters, starts, ways[0]).visibility)


def test_parameters_are_trained_by_their_gradient_and_rays_that_miss_have_none_that_is_not_finite():
    parameters, ask = ddf_jax.field(ddf.load("rabbit-network"))
    starts, ways = _rays(60, 1.5)

    @jax.jit
    def loss(own):
        found = ask(own, starts, ways)
        return jnp.where(jnp.isfinite(found.depth), (found.depth - 3) ** 2, 0).sum() + found.normals.sum()

    value, slopes = jax.value_and_grad(loss)(parameters)
    assert all(np.isfinite(each).all() for each in jax.tree.leaves(slopes))
    assert loss(jax.tree.map(lambda own, slope: own - 1e-7 * slope, parameters, slopes)) < value


def test_what_is_no_field_is_an_error():
    with pytest.raises(ValueError, match=r"give a field of ddf\.load"):
        ddf_jax.field(3)
    with pytest.raises(ValueError, match="must fit each other"):
        ddf_jax.field(ddf.load("rabbit"))[1]({}, np.zeros((2, 3)), np.eye(3))

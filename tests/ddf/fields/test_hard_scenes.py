"""Hard scenes of several fields: nothing visible, touching, far away, extreme constants. Truth: constant fields."""

import math

import numpy as np
import pytest
import torch
from _hard import assert_exact, assert_refused, assert_within, step

from ddf.fields import composition
from ddf.geometry import transforms

TEMPERATURE, INVERSE_DEPTH = 1e-4, 0.05  # η_T and ε_s


def _fixed(visibility, depth, at=(0.0, 0.0, 0.0)):
    """A field of the cube around `at` that says the same everywhere."""

    def query(positions, _):
        return torch.full_like(positions[:, 0], visibility), torch.full_like(positions[:, 0], depth)

    return composition.Placed(query, transforms.Similarity(1.0, np.eye(3), np.array(at)).inverse())


def _ray(objects, dtype, temperature=TEMPERATURE, inverse_depth=INVERSE_DEPTH, start=(0.0, 0.0, 0.0)):
    """The composite of the ray from `start` along z; the gradient of visibility and depth in the start is finite."""
    positions = torch.tensor([start], dtype=dtype, requires_grad=True)
    directions = torch.tensor([[0.0, 0.0, 1.0]], dtype=dtype)
    found = composition.compose(objects, positions, directions, temperature, inverse_depth)
    finite = torch.where(torch.isfinite(found.depth), found.depth, 0.0)
    (gradient,) = torch.autograd.grad((finite + found.visibility).sum() + 0.0 * positions.sum(), positions)
    assert torch.isfinite(gradient).all()
    return found


FAR_BEHIND = [_fixed(1.0, 0.5), _fixed(1.0, 0.0, (0.0, 0.0, 1e4))]


@pytest.mark.parametrize(
    ("objects", "start", "visibility", "depth", "nearest"),
    [
        pytest.param([_fixed(1.0, 0.0)] * 2, 0.0, 1.0, 0.0, 0.0, id="both at depth 0"),
        pytest.param([_fixed(0.0, d) for d in (0.25, 0.5, 0.75)], 0.0, 0.0, 0.5, math.inf, id="nothing visible"),
        pytest.param([_fixed(0.75, 0.5)] * 2, 0.0, 0.9375, 0.5, 0.5, id="the same field twice"),
        pytest.param([_fixed(1.0, 0.5)] * 2, 5.0, 0.0, math.inf, math.inf, id="every box missed"),
        pytest.param(FAR_BEHIND, 0.0, 1.0, 0.5, 0.5, id="a field far behind another"),
    ],
)
def test_composites_of_constant_fields(objects, start, visibility, depth, nearest, dtype):
    found = _ray(objects, dtype, start=(start, 0.0, 0.0))
    assert_within(found.visibility, [visibility], 4 * step(dtype))
    assert_within(found.depth, [depth], 4 * step(dtype))
    assert_exact(found.nearest_depth, [nearest])
    if start:
        assert found.queries == 0


@pytest.mark.parametrize(("constant", "depth"), [(1e-30, 0.25), (1e-300, 0.25), (1e30, 0.375)])
def test_tiny_and_huge_constants_give_the_nearer_one_and_the_mean(constant, depth, dtype):
    found = _ray([_fixed(1.0, 0.25), _fixed(1.0, 0.5)], dtype, constant, constant)
    assert_within(found.depth, [depth], 4 * step(dtype))
    assert_exact(found.visibility, [1.0])


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
@pytest.mark.parametrize("name", ["temperature", "inverse_depth"])
def test_constants_that_are_not_positive_and_finite_are_refused(name, value, dtype):
    assert_refused(lambda: _ray([_fixed(1.0, 0.5)], dtype, **{name: value}), f"{name} must be positive and finite")


def test_an_empty_scene_is_refused(dtype):
    assert_refused(lambda: _ray([], dtype), "at least one object")

"""Rays and the box that they enter: on its surface, along the axes, from far away; gradients; what is no ray."""

import itertools
import math

import jaxtyping
import pytest
import torch
from _hard import assert_exact, assert_refused, assert_within, lattice_rays, step
from torch.nn import functional

from ddf.core import checks
from ddf.geometry import rays

LOWER, UPPER = -torch.ones(3, dtype=torch.float64), torch.ones(3, dtype=torch.float64)


def _unit(generator, *shape):
    return torch.nn.functional.normalize(torch.randn(*shape, generator=generator, dtype=torch.float64), dim=-1)


def test_entry_lies_on_the_box_and_further_along_the_same_ray():
    generator = torch.Generator().manual_seed(0)
    start, direction = 3 * _unit(generator, 5000, 3), _unit(generator, 5000, 3)
    entry, distance, meets = rays.enter_box(start, direction, LOWER, UPPER)
    assert 0.02 < meets.double().mean() < 0.5
    torch.testing.assert_close(entry[meets], (start + distance[:, None] * direction)[meets], rtol=0, atol=1e-12)
    torch.testing.assert_close(entry[meets].abs().amax(-1), torch.ones(int(meets.sum()), dtype=torch.float64))
    assert torch.equal(entry[~meets], start[~meets])
    assert bool((distance[~meets] == 0).all())


def test_rays_that_miss_never_come_inside():
    generator = torch.Generator().manual_seed(1)
    start, direction = 3 * _unit(generator, 300, 3), _unit(generator, 300, 3)
    meets = rays.enter_box(start, direction, LOWER, UPPER)[2]
    along = start[:, None] + torch.linspace(0, 6, 2000, dtype=torch.float64)[:, None] * direction[:, None]
    inside = (along.abs() <= 1 - 1e-9).all(-1).any(-1)
    assert not bool((inside & ~meets).any())
    assert int((inside & meets).sum()) >= 0.9 * int(meets.sum())


def test_entry_is_differentiable():
    start = torch.tensor([[3.0, 0.2, 0.1]], dtype=torch.float64, requires_grad=True)
    direction = torch.nn.functional.normalize(torch.tensor([[-1.0, 0.1, 0.05]], dtype=torch.float64), dim=-1)
    entry = lambda p, v: rays.enter_box(p, v, LOWER, UPPER)[0]  # noqa: E731
    assert torch.autograd.gradcheck(entry, (start, direction.requires_grad_()))


def test_oriented_points_of_two_shapes_are_refused():
    good = torch.tensor([[1.0, 0.0, 0.0]])
    # The annotation of the arguments says the same and is checked first where types are checked at run time.
    with pytest.raises((checks.InputError, jaxtyping.TypeCheckError), match=r"one shape|existing value|Float"):
        rays.OrientedPoints(torch.zeros(2, 3), good)


def test_a_box_is_entered_at_once_from_its_boundary(dtype):
    """Starts on corners, edges, faces and at the centre, 52 directions each, zeros of both signs."""
    positions, directions = lattice_rays(dtype)
    one = torch.ones(3, dtype=dtype)
    entry, distance, meets = rays.enter_box(positions, directions, -one, one)
    assert meets.all()
    assert_exact(distance, torch.zeros(len(positions)))
    assert_exact(entry, positions)


@pytest.mark.parametrize("zero", [0.0, -0.0])
@pytest.mark.parametrize(("axis", "sign"), [*itertools.product(range(3), (-1.0, 1.0))])
def test_a_ray_along_an_axis_meets_the_closed_slab_and_misses_an_epsilon_beside_it(axis, sign, zero, dtype):
    one = torch.ones(3, dtype=dtype)
    direction = torch.full((3,), zero, dtype=dtype)
    direction[axis] = sign
    start = torch.tensor([1.0, 1.0 + step(dtype), 1.0 - step(dtype)], dtype=dtype)[:, None].repeat(1, 3)
    start[:, axis] = -5.0 * sign
    _, distance, meets = rays.enter_box(start, direction.expand(3, 3), -one, one)
    assert_exact(meets, [1, 0, 1])
    assert_exact(distance, [4.0, 0.0, 4.0])


def test_starts_a_thousand_boxes_away_enter_where_they_aim_and_never_outside(dtype):
    generator = torch.Generator().manual_seed(0)
    target = 1.8 * torch.rand(1000, 3, generator=generator, dtype=torch.float64) - 0.9
    target[:, 0] = -1.0
    direction = torch.randn(1000, 3, generator=generator, dtype=torch.float64)
    direction[:, 0] = direction.norm(dim=-1)  # at least 45 degrees to the face, so that the face is what it enters by
    direction = functional.normalize(direction, dim=-1)
    start, one = (target - 2000 * direction).to(dtype), torch.ones(3, dtype=dtype)
    entry, distance, meets = rays.enter_box(start, direction.to(dtype), -one, one)
    assert meets.all()
    assert (entry.abs() <= 1).all()
    assert_within(distance, torch.full((1000,), 2000.0), 4000 * step(dtype))
    assert_within(entry, target, 4000 * step(dtype))


@pytest.mark.parametrize("length", [0.0, 0.9998, 1.0002, 2.0])
def test_directions_that_are_not_unit_are_refused(length, dtype):
    direction = torch.tensor([[0.6 * length, 0.8 * length, 0.0]], dtype=dtype)
    rule = rf"directions must be unit length \(tol 0\.0001\); got {length:g} at index \(0,\)"
    assert_refused(lambda: rays.OrientedPoints(torch.zeros_like(direction), direction), rule)


def test_directions_off_by_1e_5_are_kept(dtype):
    near = torch.tensor([[1 - 1e-5, 0.0, 0.0], [0.0, 0.0, 1 + 1e-5]], dtype=dtype)
    assert_exact(rays.OrientedPoints(torch.zeros_like(near), near).directions, near)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_values_that_are_not_finite_are_refused(value, dtype):
    good = torch.tensor([[0.0, 1.0, 0.0]], dtype=dtype)
    bad = torch.tensor([[0.0, 1.0, value]], dtype=dtype)
    told = rf"positions must be finite; got {value} at index \(0, 2\)"
    assert_refused(lambda: rays.OrientedPoints(bad, good), told)
    assert_refused(lambda: rays.OrientedPoints(good, bad), "directions must be unit length")


def test_no_rays_give_arrays_of_length_zero(dtype):
    nothing, one = torch.zeros(0, 3, dtype=dtype), torch.ones(3, dtype=dtype)
    found = rays.enter_box(nothing, nothing, -one, one)
    assert [tuple(t.shape) for t in found] == [(0, 3), (0,), (0,)]

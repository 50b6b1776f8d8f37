"""Rays and the box that they enter: entries lie on it, misses stay outside, gradients pass."""

import jaxtyping
import pytest
import torch

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

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


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_exact_zero_components_hit_and_miss_by_position_alone(axis):
    direction = torch.zeros(3, dtype=torch.float64)
    direction[axis] = 1.0
    inside, outside, edge = (torch.full((3,), x, dtype=torch.float64) for x in (0.3, 1.3, 1.0))
    for point in (inside, outside, edge):
        point[axis] = -5.0
    _, distance, meets = rays.enter_box(torch.stack((inside, outside, edge)), direction.expand(3, 3), LOWER, UPPER)
    assert meets.tolist() == [True, False, True]
    assert distance.tolist() == [4.0, 0.0, 4.0]


def test_start_inside_stays_and_start_behind_misses():
    start = torch.tensor([[0.2, 0.1, 0.0], [3.0, 0.0, 0.0]], dtype=torch.float64)
    direction = torch.tensor([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], dtype=torch.float64)
    entry, distance, meets = rays.enter_box(start, direction, LOWER, UPPER)
    assert meets.tolist() == [True, False]
    assert torch.equal(entry, start)
    assert distance.tolist() == [0.0, 0.0]


def test_far_camera_enters_exactly_on_the_box_in_float32():
    generator = torch.Generator().manual_seed(2)
    target = (torch.rand(1000, 3, generator=generator) - 0.5).float()
    start = 2000 * _unit(generator, 1000, 3).float()
    direction = torch.nn.functional.normalize(target - start, dim=-1)
    entry, _, meets = rays.enter_box(start, direction, LOWER.float(), UPPER.float())
    assert bool(meets.all())
    assert float(entry.abs().max()) <= 1.0


def test_entry_is_differentiable():
    start = torch.tensor([[3.0, 0.2, 0.1]], dtype=torch.float64, requires_grad=True)
    direction = torch.nn.functional.normalize(torch.tensor([[-1.0, 0.1, 0.05]], dtype=torch.float64), dim=-1)
    assert torch.autograd.gradcheck(
        lambda p, v: rays.enter_box(p, v, LOWER, UPPER)[0], (start, direction.requires_grad_())
    )


def test_bad_oriented_points_are_named():
    good = torch.tensor([[1.0, 0.0, 0.0]])
    with pytest.raises(
        checks.InputError, match=r"directions must be unit length \(tol 0.0001\); got 2 at index \(0,\)"
    ):
        rays.OrientedPoints(good, 2 * good)
    with pytest.raises(checks.InputError, match="positions must be finite; got nan"):
        rays.OrientedPoints(good * float("nan"), good)
    # The annotation of the arguments says the same and is checked first where types are checked at run time.
    with pytest.raises((checks.InputError, jaxtyping.TypeCheckError), match=r"one shape|existing value|Float"):
        rays.OrientedPoints(torch.zeros(2, 3), good)

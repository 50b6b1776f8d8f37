"""Points of a box projected to the surface: starts, directions, rechecks, cycles; those that make a cloud of a size."""

import dataclasses
import math
import os
import subprocess
import sys

import pytest
import torch
from _sphere_field import CONFIG, RADIUS, SPREAD, Sphere, projected, sample

from ddf.fields import cloud_projection, pddf


def test_points_land_on_the_surface_and_cover_it():
    (points,) = cloud_projection.select(sample(2000), [2000], CONFIG)
    assert points.shape == (2000, 3)
    assert float((points.norm(dim=-1) - RADIUS).abs().max()) < 1e-4
    octants = ((points > 0).long() * torch.tensor([1, 2, 4])).sum(-1).bincount(minlength=8)
    assert int(octants.min()) > 150


def test_queries_are_points_times_directions_plus_one_per_cycle_and_two_for_each_recheck():
    plain, rechecked = Sphere(), Sphere()
    cycles = sample(100, field=plain)
    assert plain.queries == 110 * (128 + 1) * 3
    one = dataclasses.replace(CONFIG, cycles=1)
    assert torch.equal(cycles[0].points, sample(100, one)[0].points)
    sample(100, dataclasses.replace(one, recheck=(0.1, 0.2)), field=rechecked)
    assert rechecked.queries == 110 * (128 + 1 + 4)


@pytest.mark.parametrize("changes", [{"recheck": (0.1,)}, {"aimed": 0.5}])
def test_chunks_change_no_point(changes, monkeypatch):
    config, found = dataclasses.replace(CONFIG, cycles=1, **changes), []
    for rays in (128 * 7, 10**6):
        monkeypatch.setattr(cloud_projection, "CHUNK_RAYS", {"cpu": rays})
        found.append(sample(200, config)[0].points)
    torch.testing.assert_close(*found)


def test_aimed_directions_find_what_uniform_ones_miss():
    """From near a corner of the box a ball of radius 0.6 fills 4 % of the view."""
    start, seen = torch.full((400, 3), 0.9), {}
    for aimed in (0.0, 0.5, 1.0):
        config = dataclasses.replace(CONFIG, num_directions=2, cycles=1)
        generator = torch.Generator().manual_seed(0)
        found = cloud_projection.project(Sphere(), None, start, config, generator, aimed=aimed)
        seen[aimed] = float((found.visibility > 0.5).float().mean())
    assert seen[0.0] < 0.13 and 3 * seen[0.0] < seen[0.5] < seen[1.0]


def test_later_cycles_are_not_aimed_and_the_uniform_directions_stay():
    class _Recording(Sphere):
        asked: tuple[torch.Tensor, ...] = ()

        def forward(self, positions, directions, modulations=None):
            self.asked = (*self.asked, directions.clone())
            return super().forward(positions, directions, modulations)

    plain, aimed = fields = (_Recording(), _Recording())
    for share, field in zip((0.0, 0.5), fields, strict=True):
        sample(50, dataclasses.replace(CONFIG, num_directions=4, cycles=2, aimed=share), field=field)
    first, second = (field.asked[0].reshape(-1, 4, 3) for field in fields)
    assert torch.equal(first[:, 2:], second[:, 2:]) and not torch.isclose(first[:, :2], second[:, :2]).all(-1).any()
    torch.testing.assert_close(plain.asked[2], aimed.asked[2])  # of the second cycle


def test_direction_is_towards_the_nearest_point_of_the_sphere():
    generator = torch.Generator().manual_seed(3)
    points = torch.nn.functional.normalize(torch.randn(50, 3, generator=generator), dim=-1) * 0.85
    many = dataclasses.replace(CONFIG, num_directions=4096, cycles=1, temperature=0.02)
    found = cloud_projection.project(Sphere(), None, points, many, generator)
    cosine = torch.nn.functional.cosine_similarity(found.points, points, dim=-1)
    assert float(cosine.median()) > math.cos(math.radians(3))


def test_jitter_moves_the_starts_of_later_cycles_alone():
    field = Sphere()
    moved = sample(100, dataclasses.replace(CONFIG, jitter=0.1), field=field)
    still = sample(100)
    assert torch.equal(moved[0].points, still[0].points)
    # from the surface itself a cycle finds the point that it started from; from beside it, another one
    assert float((still[1].points - still[0].points).norm(dim=-1).median()) < 1e-3
    step = (moved[1].points - moved[0].points).norm(dim=-1)
    assert 0.05 < float(step.median()) < 0.3
    hit = moved[2].visibility > 0.5
    assert float((moved[2].points[hit].norm(dim=-1) - RADIUS).abs().max()) < 1e-4
    assert field.queries == 110 * (128 + 1) * 3


class _Blurred(Sphere):
    """The sphere with wrong depths where a ray starts farther than `reach` from the surface."""

    reach = 0.15

    def forward(self, positions, directions, modulations=None):
        raw = super().forward(positions, directions, modulations)
        far = ((positions.norm(dim=-1) - RADIUS).abs() > self.reach)[:, None]
        return torch.where(far, raw + torch.tensor([0.07, 0.07, 0.0, 0.0]), raw)


def test_recheck_outvotes_a_wrong_depth_from_afar():
    generator = torch.Generator().manual_seed(0)
    directions = torch.nn.functional.normalize(torch.randn(60, 3, generator=generator), dim=-1)
    wrong = (RADIUS - 0.07) * directions  # where a ray from outside, looking inwards, would have landed
    for offsets in ((0.1,), (0.05, 0.1, 0.2)):
        found, _ = cloud_projection.recheck(_Blurred(), None, wrong, -directions, torch.ones(60), offsets)
        assert float((found.norm(dim=-1) - RADIUS).abs().max()) < 1e-4


class _Plane(Sphere):
    """The plane x = 0.93."""

    def forward(self, positions, directions, modulations=None):
        depth = (0.93 - positions[:, 0]) / directions[:, 0]
        return torch.stack((depth, depth, torch.ones_like(depth), torch.ones_like(depth)), dim=-1)


def test_recheck_asks_nothing_of_starts_outside_the_cube():
    point, looking = torch.tensor([[0.95, 0.0, 0.0]]), torch.tensor([[-1.0, 0.0, 0.0]])
    for offset, expected in ((0.04, 0.93), (0.06, 0.95)):  # 1.01 is outside: one answer from behind is no majority
        found, confidence = cloud_projection.recheck(_Plane(), None, point, looking, torch.tensor([0.2]), (offset,))
        torch.testing.assert_close(found, torch.tensor([[expected, 0.0, 0.0]]))
        yes = float(torch.tensor(1.0).sigmoid())
        assert float(confidence) == pytest.approx((0.2 + yes + (yes if offset == 0.04 else 0.2)) / 3)


@pytest.mark.parametrize("spread", [None, 2.0])
def test_hits_outside_the_box_are_chosen_last(spread, monkeypatch):
    monkeypatch.setattr(cloud_projection, "OVERSAMPLING", 1.0)

    class _Overshooting(Sphere):
        """Puts what it sees from starts with x > 0.5 far outside the box, as sure of it as of all else."""

        def forward(self, positions, directions, modulations=None):
            raw = super().forward(positions, directions, modulations)
            raw[..., : pddf.NUM_COMPONENTS] += 5.0 * (positions[..., :1] > 0.5)
            return raw

    config = dataclasses.replace(CONFIG, num_directions=16, cycles=1, spread=spread)
    cycles = sample(200, config, field=_Overshooting())
    outside = (cycles[0].points.abs() > 1 + cloud_projection.BEYOND).any(dim=-1)
    assert 50 < int(outside.sum()) < 150
    assert float(cycles[0].visibility[outside].max()) == float(cycles[0].confidence[outside].max()) == 0
    (cloud,) = cloud_projection.select(cycles, [200], config)
    assert float(cloud.abs().max()) <= 1 + cloud_projection.BEYOND


def test_most_visible_drops_the_least_visible():
    early = projected(100 + torch.arange(33.0).reshape(11, 3), torch.ones(11))
    last = projected(torch.arange(33.0).reshape(11, 3), torch.arange(11.0))
    assert cloud_projection.num_drawn(10) == 11
    kept, fewer = cloud_projection.select([early, last], [10, 4], CONFIG)
    assert sorted(kept[:, 0].tolist()) == [3.0 * i for i in range(1, 11)]
    # a smaller cloud is made from the first draws alone
    assert sorted(fewer[:, 0].tolist()) == [3.0, 6.0, 9.0, 12.0]


def test_spread_covers_evenly_and_nests_the_sizes():
    cycles = sample(400, SPREAD)
    large, small = cloud_projection.select(cycles, [400, 150], SPREAD)
    assert (large.shape, small.shape) == ((400, 3), (150, 3))
    assert torch.equal(large[:150], small)
    (uneven,) = cloud_projection.select(cycles, [400], dataclasses.replace(SPREAD, spread=None))
    spread, crowded = (_nearest_neighbour_spread(cloud) for cloud in (large, uneven))
    assert spread < 0.8 * crowded


def test_spread_chooses_from_the_second_cycle_on_or_from_the_only_one():
    cycles = [projected(torch.rand(11, 3) + 2 * i, torch.ones(11)) for i in range(3)]
    (cloud,) = cloud_projection.select(cycles, [10], SPREAD)
    assert float(cloud.min()) >= 2 and bool((cloud >= 4).any()) and bool((cloud < 4).any())
    (alone,) = cloud_projection.select(cycles[:1], [10], SPREAD)
    assert float(alone.max()) <= 1


def test_spread_sets_few_points_where_the_field_doubts():
    sure, doubtful = torch.rand(300, 3), torch.rand(300, 3) + torch.tensor([2.0, 0, 0])
    confidence = torch.cat((torch.ones(300), torch.full((300,), 0.5)))
    (cloud,) = cloud_projection.select([projected(torch.cat((sure, doubtful)), confidence)], [100], SPREAD)
    share = float((cloud[:, 0] > 1.5).float().mean())
    assert 0 < share < 0.15


def test_crowding_takes_strays_later():
    generator = torch.Generator().manual_seed(0)
    strays = torch.tensor([[3.0, 0, 0], [-3.0, 0, 0], [0, 3.0, 0]])
    points = torch.cat((torch.rand(400, 3, generator=generator), strays))
    cycles = [projected(points, torch.ones(403))]
    found = {}
    for power in (0.0, 2.0):
        config = dataclasses.replace(SPREAD, crowding=power)
        (cloud,) = cloud_projection.select(cycles, [100], config)
        found[power] = int((cloud.abs() > 1).any(dim=1).sum())
    assert found == {0.0: 3, 2.0: 0}


@pytest.mark.parametrize(("doubtful", "left"), [(60, 0), (150, 50)])
def test_doubtful_candidates_are_left_out_as_far_as_enough_remain(doubtful, left):
    points = torch.rand((200, 3), generator=torch.Generator().manual_seed(0))
    points[:doubtful] += 5.0
    confidence = torch.linspace(0.01, 0.09, doubtful).tolist() + [0.8] * (200 - doubtful)
    config = dataclasses.replace(SPREAD, least_confidence=0.1)
    (cloud,) = cloud_projection.select([projected(points, torch.tensor(confidence))], [100], config)
    assert int((cloud > 4).any(dim=1).sum()) == left
    if left:  # the most confident of them
        kept, best = cloud[(cloud > 4).any(dim=1)].tolist(), points[doubtful - left : doubtful].tolist()
        assert sorted(kept) == sorted(best)


def test_crowding_of_repeated_points_is_finite():
    config = dataclasses.replace(SPREAD, crowding=1.0)
    points = torch.cat((torch.ones(20, 3), torch.zeros(2, 3)))
    (cloud,) = cloud_projection.select([projected(points, torch.ones(22))], [20], config)
    assert bool(torch.isfinite(cloud).all()) and bool((cloud[:2].sum(dim=1) == torch.tensor([3.0, 0.0])).all())


def _nearest_neighbour_spread(points):
    """Deviation over mean of the distances to the nearest neighbour: 0 on a lattice, 0.52 for random points."""
    distance = torch.cdist(points, points).fill_diagonal_(torch.inf).amin(dim=1)
    return float(distance.std() / distance.mean())


def test_farthest_points_equal_a_slow_loop():
    points = torch.rand(60, 3, generator=torch.Generator().manual_seed(0))
    order = cloud_projection.farthest_point_order(points, 20).tolist()
    assert order[0] == 0
    for i in range(1, 20):
        nearest = torch.cdist(points, points[order[:i]]).amin(dim=1)
        assert order[i] == int(nearest.argmax())


def test_weights_space_points_by_their_inverse():
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(4000, 3, generator=generator)
    points[:, 2] = 0
    heavy = points[:, 0] > 0.5
    order = cloud_projection.farthest_point_order(points, 500, torch.where(heavy, 1.0, 0.5))
    assert heavy[order[0]]
    share = float(heavy[order].float().mean())
    assert share == pytest.approx(0.8, abs=0.03)  # spacing twice as wide: a quarter of the points on equal area


INTERPRETED = """
import torch
from ddf.fields import cloud_projection, farthest_kernel

random = torch.Generator().manual_seed(1)
for number, count in ((1, 1), (64, 64), (300, 40)):  # a block has a power of two
    points, weights = torch.randn((number, 3), generator=random), torch.rand(number, generator=random) + 0.1
    expected = cloud_projection.farthest_point_order(points, count, weights)
    assert torch.equal(farthest_kernel.order(points, count, weights), expected) and len(expected.unique()) == count
points, weights = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]), torch.tensor([0.5, 0.9, 0.9])
order = farthest_kernel.order(points, 5, weights)  # indices repeat once all places are taken: none of what pads a block
assert order.tolist() == cloud_projection.farthest_point_order(points, 5, weights).tolist() and int(order.max()) < 3
print("the same")
"""


def test_the_kernel_of_a_gpu_gives_the_order_of_numpy():
    pytest.importorskip("triton")
    environment = os.environ | {"TRITON_INTERPRET": "1"}  # asked for before Triton is imported: in another process
    done = subprocess.run([sys.executable, "-c", INTERPRETED], env=environment, capture_output=True, text=True)
    assert done.stdout == "the same\n", done.stderr[-2000:]


def test_the_kernel_takes_no_more_points_than_it_can_keep():
    found = [cloud_projection.fits(torch.zeros(count, 3, dtype=dtype)) for count, dtype in (
        (2**14, torch.float32), (2**14 + 1, torch.float32), (9, torch.float64),
    )]  # fmt: skip
    assert found == [True, False, False]


@pytest.mark.gpu
@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
def test_a_gpu_gives_the_order_of_the_cpu():
    random = torch.Generator().manual_seed(2)
    points, weights = torch.randn((11_000, 3), generator=random), torch.rand(11_000, generator=random) + 0.1
    expected = cloud_projection.farthest_point_order(points, 5000, weights)
    found = cloud_projection.farthest_point_order(points.cuda(), 5000, weights.cuda())
    assert found.is_cuda and torch.equal(found.cpu(), expected)

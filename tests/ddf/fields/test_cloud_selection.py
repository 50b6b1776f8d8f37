"""The points of a cloud among its candidates: order and crowding."""

import dataclasses

import pytest
import torch
from _sphere_field import CONFIG, SPREAD, Sphere, projected, sample

from ddf.fields import cloud_projection


def test_most_visible_drops_the_least_visible():
    early = projected(100 + torch.arange(33.0).reshape(11, 3), torch.ones(11))
    last = projected(torch.arange(33.0).reshape(11, 3), torch.arange(11.0))
    assert CONFIG.num_drawn(10) == 11
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
        assert {tuple(p) for p in cloud[(cloud > 4).any(dim=1)].tolist()} == {
            tuple(p) for p in points[doubtful - left : doubtful].tolist()
        }


@pytest.mark.parametrize("count", [1, 5, 9, 16, 17, 300])
def test_spacing_is_the_distance_to_the_eighth_of_the_others(count):
    points = torch.rand((count, 3), generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    nearest = torch.cdist(points, points).sort(dim=1).values
    torch.testing.assert_close(cloud_projection._spacing(points), nearest[:, min(8, count - 1)])


def test_crowding_of_repeated_points_is_finite():
    config = dataclasses.replace(SPREAD, crowding=1.0)
    points = torch.cat((torch.ones(20, 3), torch.zeros(2, 3)))
    (cloud,) = cloud_projection.select([projected(points, torch.ones(22))], [20], config)
    assert bool(torch.isfinite(cloud).all()) and bool((cloud[:2].sum(dim=1) == torch.tensor([3.0, 0.0])).all())


def test_candidates_of_two_cycles_are_enough_with_fewer_starts_than_points():
    config = dataclasses.replace(SPREAD, num_directions=8, cycles=3, oversampling=-0.45, jitter=0.1)
    field = Sphere()
    cycles = cloud_projection.sample(field, None, 100, config, torch.Generator().manual_seed(0))
    assert field.queries == 3 * 55 * (8 + 1)
    (cloud,) = cloud_projection.select(cycles, [100], config)
    assert len(torch.unique(cloud, dim=0)) == 100
    assert config.candidate_share(1) < 1 <= config.candidate_share(3)


def _nearest_neighbour_spread(points):
    """Deviation over mean of the distances to the nearest neighbour: 0 on a lattice, 0.52 for random points."""
    distance = torch.cdist(points, points).fill_diagonal_(torch.inf).amin(dim=1)
    return float(distance.std() / distance.mean())

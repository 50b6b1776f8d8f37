"""The points of a cloud among its candidates: order, crowding, centring, mirror images."""

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


def test_farthest_points_equal_a_slow_loop():
    points = torch.rand(60, 3, generator=torch.Generator().manual_seed(0))
    order = cloud_projection.farthest_point_order(points, 20).tolist()
    assert order[0] == 0
    for i in range(1, 20):
        nearest = torch.cdist(points, points[order[:i]]).amin(dim=1)
        assert order[i] == int(nearest.argmax())


def test_farthest_points_of_repeated_points_are_finite():
    points = torch.ones(5, 3)
    assert cloud_projection.farthest_point_order(points, 5).tolist() == [0] * 5


def test_weights_space_points_by_their_inverse():
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(4000, 3, generator=generator)
    points[:, 2] = 0
    heavy = points[:, 0] > 0.5
    order = cloud_projection.farthest_point_order(points, 500, torch.where(heavy, 1.0, 0.5))
    assert heavy[order[0]]
    share = float(heavy[order].float().mean())
    assert share == pytest.approx(0.8, abs=0.03)  # spacing twice as wide: a quarter of the points on equal area


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


def test_doubtful_candidates_are_left_out_while_enough_remain():
    config = dataclasses.replace(SPREAD, least_confidence=0.5)
    sure = torch.rand(60, 3, generator=torch.Generator().manual_seed(0))
    strays = torch.tensor([[3.0, 0, 0], [-3.0, 0, 0]])
    cycles = [projected(torch.cat((sure, strays)), torch.cat((torch.full((60,), 0.5), torch.full((2,), 0.49))))]
    (kept,) = cloud_projection.select(cycles, [56], dataclasses.replace(config, least_confidence=0.0))
    assert float(kept.abs().max()) == 3
    for least in (0.5, 1.0):
        (cloud,) = cloud_projection.select(cycles, [56], dataclasses.replace(config, least_confidence=least))
        assert len(torch.unique(cloud, dim=0)) == 56 and float(cloud.abs().max()) <= 1
    (needed,) = cloud_projection.select(cycles, [62], config)
    assert len(torch.unique(needed, dim=0)) == 62


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


def test_cells_are_of_the_nearest_in_the_order():
    points = torch.rand(300, 3, generator=torch.Generator().manual_seed(0))
    weights = torch.rand(300, generator=torch.Generator().manual_seed(1)) + 0.1
    order, cells = cloud_projection.farthest_point_cells(points, 40, weights)
    assert torch.equal(order, cloud_projection.farthest_point_order(points, 40, weights))
    assert torch.equal(cells, torch.cdist(points, points[order]).argmin(dim=1))


def test_centred_clouds_are_weighted_means_of_their_cells():
    generator = torch.Generator().manual_seed(0)
    points, weights = torch.rand(200, 3, generator=generator), torch.rand(200, generator=generator) + 0.1
    cloud = torch.cat((points[:20], torch.full((1, 3), 9.0)))  # the last is nearest to none
    cell = torch.cdist(points, cloud).argmin(dim=1)
    expected = torch.stack(
        [(points[cell == i] * weights[cell == i, None]).sum(0) / weights[cell == i].sum() for i in range(20)]
    )
    found = cloud_projection.centred(cloud, points, cell, weights)
    torch.testing.assert_close(found[:20], expected)
    assert torch.equal(found[20], cloud[20])


def test_centring_takes_noise_from_a_sphere_and_orders_all_sizes_alike():
    generator = torch.Generator().manual_seed(0)
    directions = torch.nn.functional.normalize(torch.randn(4000, 3, generator=generator), dim=-1)
    noise = 0.02 * torch.randn(4000, 1, generator=generator)
    confidence = torch.exp(-(noise[:, 0] / 0.02).square())  # what is off is doubted
    cycles = [projected(directions * (1 + noise), confidence)]
    off = {}
    for power in (None, 0.0, 4.0):
        large, small = cloud_projection.select(
            cycles, [400, 100], dataclasses.replace(SPREAD, spread=0.0, centre=power)
        )
        off[power] = float((large.norm(dim=-1) - 1).square().mean().sqrt())
        assert torch.equal(small, large[:100])
    assert off[4.0] < off[0.0] < off[None]


def test_candidates_of_two_cycles_are_enough_with_fewer_starts_than_points():
    config = dataclasses.replace(SPREAD, num_directions=8, cycles=3, oversampling=-0.45, jitter=0.1)
    field = Sphere()
    cycles = cloud_projection.sample(field, None, 100, config, torch.Generator().manual_seed(0))
    assert field.queries == 3 * 55 * (8 + 1)
    (cloud,) = cloud_projection.select(cycles, [100], config)
    assert len(torch.unique(cloud, dim=0)) == 100
    assert config.candidate_share(1) < 1 <= config.candidate_share(3)


@pytest.mark.parametrize(("axis", "place"), [("x", 0), ("y", 1), ("z", 2)])
def test_mirror_images_of_hits_are_candidates_without_a_query(axis, place):
    config = dataclasses.replace(SPREAD, num_directions=8, cycles=2, oversampling=-0.45, mirror=axis)
    field = Sphere()
    cycles = cloud_projection.sample(field, None, 100, config, torch.Generator().manual_seed(0))
    assert field.queries == 2 * 55 * (8 + 1)
    (cloud,) = cloud_projection.select(cycles, [100], config)
    assert len(torch.unique(cloud, dim=0)) == 100
    hits, sides = cycles[-1].points, torch.ones(3)
    sides[place] = -1
    own, images = ((cloud[:, None] == one).all(-1).any(-1) for one in (hits, sides * hits))
    assert bool((own | images).all()) and int(own.sum()) > 30 and int(images.sum()) > 30
    assert config.candidate_share(2) == pytest.approx(1.1)


def _nearest_neighbour_spread(points):
    """Deviation over mean of the distances to the nearest neighbour: 0 on a lattice, 0.52 for random points."""
    distance = torch.cdist(points, points).fill_diagonal_(torch.inf).amin(dim=1)
    return float(distance.std() / distance.mean())

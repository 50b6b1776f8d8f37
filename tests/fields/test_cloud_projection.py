import dataclasses
import math

import pytest
import torch

from ddf.core import checks
from ddf.fields import cloud_projection, nearest_rays, pddf

CONFIG = cloud_projection.CloudConfig(  # the paper's way
    num_directions=128,
    cycles=3,
    oversampling=0.1,
    jitter=0.0,
    resample=0.0,
    recheck=(),
    spread=None,
    temperature=0.05,
    inverse_depth=0.01,
    chunk_rays=4096,
)
RADIUS = 0.6


class _Sphere(pddf.PDDF):
    """Exact field of a sphere (hits from inside too) in the raw outputs of a PDDF."""

    def __init__(self):
        super().__init__(pddf.PDDFConfig((4,), 1.0, 1.0, "relu", 1.0))
        self.queries = 0

    def forward(self, positions, directions, modulations=None):
        self.queries += positions.shape[0]
        along = -(positions * directions).sum(-1)
        miss_sq = positions.square().sum(-1) - along.square()
        half = (RADIUS**2 - miss_sq).clamp_min(0).sqrt()
        outside = positions.norm(dim=-1) > RADIUS
        distance = torch.where(outside, along - half, along + half)
        visible = (miss_sq < RADIUS**2) & (distance >= 0)
        depth = torch.where(visible, distance, torch.ones_like(distance))
        logit = torch.where(visible, 20.0, -20.0)
        return torch.stack((depth, depth, torch.ones_like(depth), logit), dim=-1)


def _sample(count, config=CONFIG, seed=0, field=None):
    return cloud_projection.sample(field or _Sphere(), None, count, config, torch.Generator().manual_seed(seed))


def test_points_land_on_the_surface_and_cover_it():
    (points,) = cloud_projection.select(_sample(2000), [2000], CONFIG)
    assert points.shape == (2000, 3)
    assert float((points.norm(dim=-1) - RADIUS).abs().max()) < 1e-4
    octants = ((points > 0).long() * torch.tensor([1, 2, 4])).sum(-1).bincount(minlength=8)
    assert int(octants.min()) > 150


def test_queries_are_points_times_directions_plus_one_per_cycle():
    field = _Sphere()
    _sample(100, field=field)
    assert field.queries == 110 * (128 + 1) * 3


def test_first_cycle_of_three_is_the_cloud_of_one():
    one = dataclasses.replace(CONFIG, cycles=1)
    assert torch.equal(_sample(300)[0].points, _sample(300, one)[0].points)


def test_chunks_change_no_point():
    small = dataclasses.replace(CONFIG, cycles=1, chunk_rays=128 * 7, recheck=(0.1,))
    large = dataclasses.replace(small, chunk_rays=10**6)
    torch.testing.assert_close(_sample(200, small)[0].points, _sample(200, large)[0].points)


def test_direction_is_towards_the_nearest_point_of_the_sphere():
    generator = torch.Generator().manual_seed(3)
    points = torch.nn.functional.normalize(torch.randn(50, 3, generator=generator), dim=-1) * 0.85
    many = dataclasses.replace(CONFIG, num_directions=4096, cycles=1, temperature=0.02, chunk_rays=10**6)
    found = cloud_projection.project(_Sphere(), None, points, many, generator)
    cosine = torch.nn.functional.cosine_similarity(found.points, points, dim=-1)
    assert float(cosine.median()) > math.cos(math.radians(3))


def test_cancelling_candidates_fall_back_to_the_best():
    candidates = torch.tensor([[[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]]])
    equal, depth = torch.ones(1, 4), torch.full((1, 4), 0.5)
    found = nearest_rays.closest_directions(candidates, equal, depth, CONFIG.temperature, CONFIG.inverse_depth)
    assert float(found.norm()) == pytest.approx(1.0)
    assert any(torch.equal(found[0], c) for c in candidates[0])


@pytest.mark.parametrize(("visibility", "depth"), [(0.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
def test_invisible_and_on_surface_candidates_stay_finite_and_unit(visibility, depth):
    candidates = torch.nn.functional.normalize(
        torch.randn(20, 64, 3, generator=torch.Generator().manual_seed(0)), dim=-1
    )
    tiny = dataclasses.replace(CONFIG, num_directions=64, temperature=1e-4, inverse_depth=1e-6)
    ones = torch.ones(20, 64)
    found = nearest_rays.closest_directions(
        candidates, visibility * ones, depth * ones, tiny.temperature, tiny.inverse_depth
    )
    torch.testing.assert_close(found.norm(dim=-1), torch.ones(20))


def _projected(points, visibility):
    return cloud_projection.ProjectedPoints(points, visibility, visibility)


def test_most_visible_drops_the_least_visible():
    early = _projected(100 + torch.arange(33.0).reshape(11, 3), torch.ones(11))
    last = _projected(torch.arange(33.0).reshape(11, 3), torch.arange(11.0))
    assert CONFIG.num_drawn(10) == 11
    kept, fewer = cloud_projection.select([early, last], [10, 4], CONFIG)
    assert sorted(kept[:, 0].tolist()) == [3.0 * i for i in range(1, 11)]
    # a smaller cloud is made from the first draws alone
    assert sorted(fewer[:, 0].tolist()) == [3.0, 6.0, 9.0, 12.0]


def test_jitter_moves_the_starts_of_later_cycles_alone():
    field = _Sphere()
    moved = _sample(100, dataclasses.replace(CONFIG, jitter=0.1), field=field)
    still = _sample(100)
    assert torch.equal(moved[0].points, still[0].points)
    # from the surface itself a cycle finds the point that it started from; from beside it, another one
    assert float((still[1].points - still[0].points).norm(dim=-1).median()) < 1e-3
    step = (moved[1].points - moved[0].points).norm(dim=-1)
    assert 0.05 < float(step.median()) < 0.3
    hit = moved[2].visibility > 0.5
    assert float((moved[2].points[hit].norm(dim=-1) - RADIUS).abs().max()) < 1e-4
    assert field.queries == 110 * (128 + 1) * 3


class _Blurred(_Sphere):
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


def test_recheck_asks_twice_per_offset_and_not_at_all_without():
    field = _Sphere()
    points, directions = torch.full((5, 3), 0.3), torch.nn.functional.normalize(torch.ones(5, 3), dim=-1)
    seen = torch.full((5,), 0.7)
    same, confidence = cloud_projection.recheck(field, None, points, directions, seen, ())
    assert same is points and confidence is seen and field.queries == 0
    cloud_projection.recheck(field, None, points, directions, seen, (0.1, 0.2))
    assert field.queries == 5 * 4


class _Plane(_Sphere):
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


SPREAD = dataclasses.replace(CONFIG, num_directions=64, spread=2.0)


def test_spread_covers_evenly_and_nests_the_sizes():
    cycles = _sample(400, SPREAD)
    large, small = cloud_projection.select(cycles, [400, 150], SPREAD)
    assert (large.shape, small.shape) == ((400, 3), (150, 3))
    assert torch.equal(large[:150], small)
    (uneven,) = cloud_projection.select(cycles, [400], dataclasses.replace(SPREAD, spread=None))
    spread, crowded = (_nearest_neighbour_spread(cloud) for cloud in (large, uneven))
    assert spread < 0.8 * crowded


def test_spread_chooses_from_the_second_cycle_on_or_from_the_only_one():
    cycles = [_projected(torch.rand(11, 3) + 2 * i, torch.ones(11)) for i in range(3)]
    (cloud,) = cloud_projection.select(cycles, [10], SPREAD)
    assert float(cloud.min()) >= 2 and bool((cloud >= 4).any()) and bool((cloud < 4).any())
    (alone,) = cloud_projection.select(cycles[:1], [10], SPREAD)
    assert float(alone.max()) <= 1


def test_spread_sets_few_points_where_the_field_doubts():
    sure, doubtful = torch.rand(300, 3), torch.rand(300, 3) + torch.tensor([2.0, 0, 0])
    confidence = torch.cat((torch.ones(300), torch.full((300,), 0.5)))
    (cloud,) = cloud_projection.select([_projected(torch.cat((sure, doubtful)), confidence)], [100], SPREAD)
    share = float((cloud[:, 0] > 1.5).float().mean())
    assert 0 < share < 0.15


def test_doubtful_candidates_are_left_out_while_enough_remain():
    config = dataclasses.replace(SPREAD, least_confidence=0.5)
    sure = torch.rand(60, 3, generator=torch.Generator().manual_seed(0))
    strays = torch.tensor([[3.0, 0, 0], [-3.0, 0, 0]])
    cycles = [_projected(torch.cat((sure, strays)), torch.cat((torch.full((60,), 0.5), torch.full((2,), 0.49))))]
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
    cycles = [_projected(points, torch.ones(403))]
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
    (cloud,) = cloud_projection.select([_projected(points, torch.ones(22))], [20], config)
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
    cycles = [_projected(directions * (1 + noise), confidence)]
    off = {}
    for power in (None, 0.0, 4.0):
        large, small = cloud_projection.select(
            cycles, [400, 100], dataclasses.replace(SPREAD, spread=0.0, centre=power)
        )
        off[power] = float((large.norm(dim=-1) - 1).square().mean().sqrt())
        assert torch.equal(small, large[:100])
    assert off[4.0] < off[0.0] < off[None]


def test_resampled_starts_leave_doubtful_hits_behind():
    class _Doubtful(_Sphere):
        """Hardly sees anything from starts with x > 0."""

        def forward(self, positions, directions, modulations=None):
            raw = super().forward(positions, directions, modulations)
            doubtful = positions[..., 0] > 0
            raw[..., pddf.VISIBILITY_ROW] = torch.where(doubtful, -4.0, 4.0)
            return raw

    plain = dataclasses.replace(SPREAD, num_directions=8, cycles=3, jitter=0.05)
    last = {}
    for share in (0.0, 1.0):
        config = dataclasses.replace(plain, resample=share)
        last[share] = cloud_projection.sample(_Doubtful(), None, 400, config, torch.Generator().manual_seed(0))[-1]
    doubtful = {share: float((cycle.visibility < 0.5).float().mean()) for share, cycle in last.items()}
    assert doubtful[1.0] < 0.25 * doubtful[0.0]
    assert len(last[1.0].points) == len(last[0.0].points)


@pytest.mark.parametrize("spread", [None, 2.0])
def test_hits_outside_the_box_are_chosen_last(spread):
    class _Overshooting(_Sphere):
        """Puts what it sees from starts with x > 0.5 far outside the box, as sure of it as of all else."""

        def forward(self, positions, directions, modulations=None):
            raw = super().forward(positions, directions, modulations)
            raw[..., : pddf.NUM_COMPONENTS] += 5.0 * (positions[..., :1] > 0.5)
            return raw

    config = dataclasses.replace(CONFIG, num_directions=16, cycles=1, oversampling=1.0, spread=spread)
    cycles = _sample(200, config, field=_Overshooting())
    outside = (cycles[0].points.abs() > 1 + cloud_projection.BEYOND).any(dim=-1)
    assert 50 < int(outside.sum()) < 150
    assert float(cycles[0].visibility[outside].max()) == float(cycles[0].confidence[outside].max()) == 0
    (cloud,) = cloud_projection.select(cycles, [200], config)
    assert float(cloud.abs().max()) <= 1 + cloud_projection.BEYOND


def test_candidates_of_two_cycles_are_enough_with_fewer_starts_than_points():
    config = dataclasses.replace(SPREAD, num_directions=8, cycles=3, oversampling=-0.45, jitter=0.1)
    field = _Sphere()
    cycles = cloud_projection.sample(field, None, 100, config, torch.Generator().manual_seed(0))
    assert field.queries == 3 * 55 * (8 + 1)
    (cloud,) = cloud_projection.select(cycles, [100], config)
    assert len(torch.unique(cloud, dim=0)) == 100
    assert config.candidate_share(1) < 1 <= config.candidate_share(3)


@pytest.mark.parametrize(("axis", "place"), [("x", 0), ("y", 1), ("z", 2)])
def test_mirror_images_of_hits_are_candidates_without_a_query(axis, place):
    config = dataclasses.replace(SPREAD, num_directions=8, cycles=2, oversampling=-0.45, mirror=axis)
    field = _Sphere()
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


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"num_directions": 0}, "num_directions must be >= 1; got 0"),
        ({"temperature": 0.0}, "temperature must be > 0"),
        ({"spread": -1.0}, r"spread must be >= 0, or null; got -1\.0"),
        ({"least_confidence": 1.5}, r"least_confidence must be in \[0, 1\]; got 1\.5"),
        (
            {"oversampling": -0.6, "spread": 6.0, "cycles": 3},
            "must leave enough candidates.*got 0.8 with oversampling -0.6",
        ),
        ({"mirror": "z"}, "mirror doubles the candidates of spread, which is null"),
        ({"crowding": -1.0}, r"crowding must be >= 0; got -1\.0"),
        ({"centre": 4.0}, r"centre moves points.*needs spread, or be null; got 4\.0 with spread None"),
        ({"centre": -1.0, "spread": 1.0}, r"centre .* must be >= 0 .*got -1\.0 with spread 1\.0"),
        ({"oversampling": -0.1}, "must leave enough candidates.*got 0.9 with"),
        ({"jitter": -0.1}, "jitter must be >= 0"),
        ({"resample": 1.5, "jitter": 0.1}, r"resample must be in \[0, 1\]"),
        ({"resample": 0.5}, "needs jitter > 0.*got 0.5 with jitter 0.0"),
        ({"recheck": (0.1, 1.5)}, r"recheck must list offsets in \(0, 1\)"),
    ],
)
def test_bad_config_is_refused(change, message):
    with pytest.raises(checks.InputError, match=message):
        dataclasses.replace(CONFIG, **change)

"""Points of a box projected to the surface: starts, directions, rechecks, cycles."""

import dataclasses
import math

import pytest
import torch
from _sphere_field import CONFIG, RADIUS, Sphere, sample

from ddf.core import checks
from ddf.fields import cloud_projection, pddf


def test_points_land_on_the_surface_and_cover_it():
    (points,) = cloud_projection.select(sample(2000), [2000], CONFIG)
    assert points.shape == (2000, 3)
    assert float((points.norm(dim=-1) - RADIUS).abs().max()) < 1e-4
    octants = ((points > 0).long() * torch.tensor([1, 2, 4])).sum(-1).bincount(minlength=8)
    assert int(octants.min()) > 150


def test_queries_are_points_times_directions_plus_one_per_cycle():
    field = Sphere()
    sample(100, field=field)
    assert field.queries == 110 * (128 + 1) * 3


def test_first_cycle_of_three_is_the_cloud_of_one():
    one = dataclasses.replace(CONFIG, cycles=1)
    assert torch.equal(sample(300)[0].points, sample(300, one)[0].points)


@pytest.mark.parametrize("changes", [{"recheck": (0.1,)}, {"aimed": 0.5}])
def test_chunks_change_no_point(changes):
    small = dataclasses.replace(CONFIG, cycles=1, chunk_rays=128 * 7, **changes)
    large = dataclasses.replace(small, chunk_rays=10**6)
    torch.testing.assert_close(sample(200, small)[0].points, sample(200, large)[0].points)


def test_aimed_directions_find_what_uniform_ones_miss():
    """From near a corner of the box a ball of radius 0.6 fills 4 % of the view."""
    start, seen = torch.full((400, 3), 0.9), {}
    for aimed in (0.0, 0.5, 1.0):
        config = dataclasses.replace(CONFIG, num_directions=2, cycles=1)
        generator = torch.Generator().manual_seed(0)
        found = cloud_projection.project(Sphere(), None, start, config, generator, aimed=aimed)
        seen[aimed] = float((found.visibility > 0.5).float().mean())
    assert seen[0.0] < 0.13 and 3 * seen[0.0] < seen[0.5] < seen[1.0]


def test_aimed_directions_go_evenly_to_the_box():
    normal = torch.randn(20_000, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    points = cloud_projection._in_box_uniformly(normal, ((-1.0, 0.0, 2.0), (1.0, 3.0, 2.5)))
    unit = (points - torch.tensor([-1.0, 0.0, 2.0])) / torch.tensor([2.0, 3.0, 0.5])
    assert 0 <= float(unit.min()) and float(unit.max()) <= 1
    cells = (unit * 4).long().clamp_max(3)
    counts = (cells @ torch.tensor([16, 4, 1])).bincount(minlength=64)
    expected = 20_000 / 64
    assert float(((counts - expected) ** 2 / expected).sum()) < 63 + 4 * math.sqrt(2 * 63)  # chi squared


def test_later_cycles_are_not_aimed_and_the_uniform_directions_stay():
    plain = dataclasses.replace(CONFIG, num_directions=4, cycles=2)
    aimed = dataclasses.replace(plain, aimed=0.5)
    directions = {}

    class _Recording(Sphere):
        def forward(self, positions, directions, modulations=None):
            self.asked = [*getattr(self, "asked", []), directions.clone()]
            return super().forward(positions, directions, modulations)

    for config in (plain, aimed):
        field = _Recording()
        sample(50, config, field=field)
        directions[config.aimed] = field.asked
    first, second = (asked[0].reshape(-1, 4, 3) for asked in directions.values())
    assert torch.equal(first[:, 2:], second[:, 2:]) and not torch.isclose(first[:, :2], second[:, :2]).all(-1).any()
    torch.testing.assert_close(directions[0.0][2], directions[0.5][2])  # of the second cycle


def test_direction_is_towards_the_nearest_point_of_the_sphere():
    generator = torch.Generator().manual_seed(3)
    points = torch.nn.functional.normalize(torch.randn(50, 3, generator=generator), dim=-1) * 0.85
    many = dataclasses.replace(CONFIG, num_directions=4096, cycles=1, temperature=0.02, chunk_rays=10**6)
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


def test_recheck_asks_twice_per_offset_and_not_at_all_without():
    field = Sphere()
    points, directions = torch.full((5, 3), 0.3), torch.nn.functional.normalize(torch.ones(5, 3), dim=-1)
    seen = torch.full((5,), 0.7)
    same, confidence = cloud_projection.recheck(field, None, points, directions, seen, ())
    assert same is points and confidence is seen and field.queries == 0
    cloud_projection.recheck(field, None, points, directions, seen, (0.1, 0.2))
    assert field.queries == 5 * 4


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
def test_hits_outside_the_box_are_chosen_last(spread):
    class _Overshooting(Sphere):
        """Puts what it sees from starts with x > 0.5 far outside the box, as sure of it as of all else."""

        def forward(self, positions, directions, modulations=None):
            raw = super().forward(positions, directions, modulations)
            raw[..., : pddf.NUM_COMPONENTS] += 5.0 * (positions[..., :1] > 0.5)
            return raw

    config = dataclasses.replace(CONFIG, num_directions=16, cycles=1, oversampling=1.0, spread=spread)
    cycles = sample(200, config, field=_Overshooting())
    outside = (cycles[0].points.abs() > 1 + cloud_projection.BEYOND).any(dim=-1)
    assert 50 < int(outside.sum()) < 150
    assert float(cycles[0].visibility[outside].max()) == float(cycles[0].confidence[outside].max()) == 0
    (cloud,) = cloud_projection.select(cycles, [200], config)
    assert float(cloud.abs().max()) <= 1 + cloud_projection.BEYOND


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"temperature": 0.0}, "temperature"),
        ({"least_confidence": 1.5}, "least_confidence"),
        ({"oversampling": -0.6, "spread": 6.0, "cycles": 3}, "enough candidates.*got 0.8"),
        ({"oversampling": -0.1}, "enough candidates.*got 0.9"),
        ({"recheck": (0.1, 1.5)}, "recheck"),
    ],
)
def test_bad_config_is_refused(change, message):
    with pytest.raises(checks.InputError, match=message):
        dataclasses.replace(CONFIG, **change)

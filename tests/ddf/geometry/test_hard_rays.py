"""Hard rays: grazing, on the surface, along the axes, from far away, refused. Truth: spheres, planes, tori, boxes."""

import itertools
import math

import _closed_form
import pytest
import torch
from _hard import SLOPES, TARGETS, assert_exact, assert_refused, assert_within, lattice_rays, step
from torch.nn import functional

from ddf.geometry import primitives, rays


def _cast(shape, positions, directions):
    return primitives.cast(shape, rays.OrientedPoints(positions, directions))


def _along_x(starts, dtype):
    positions = torch.tensor(starts, dtype=torch.float64).to(dtype)
    return positions, torch.tensor([1.0, 0.0, 0.0], dtype=dtype).expand_as(positions)


def _sine(cosine):
    """sqrt(1 - y²) without cancellation, float64."""
    return torch.sqrt((1 - cosine.double()) * (1 + cosine.double()))


def test_grazing_a_sphere_hits_at_two_less_the_slope(dtype):
    """Within 2 ε/|n·v| and sqrt(2 ε): what the rounding of a start changes."""
    positions, directions = _along_x([(-2.0, math.sqrt(1 - s * s), 0.0) for s in SLOPES], dtype)
    slope = _sine(positions[:, 1])
    hits = _cast(primitives.Sphere(), positions, directions)
    allowed = (2 * step(dtype) / slope).clamp_max(math.sqrt(2 * step(dtype)))
    assert_within((hits.normals * directions).sum(-1), -slope, allowed)
    assert_within(hits.depth, 2 - slope, allowed)


@pytest.mark.parametrize("slope", SLOPES)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_grazing_a_plane_hits_and_the_normal_faces_back(slope, sign, dtype):
    positions, directions = _along_x([(-2.0, 0.0, 0.0)], dtype)
    hits = _cast(_closed_form.Plane((sign * slope, math.sqrt(1 - slope * slope), 0.0)), positions, directions)
    assert_within((hits.normals * directions).sum(-1), [-slope], 2 * step(dtype) * slope)
    assert_within(hits.depth, [2.0], 4 * step(dtype))


def test_grazing_a_torus_hits_as_near_as_a_double_root_is_known(dtype):
    """Starts in the type, the roots of the quartic in float64: sqrt(ε)."""
    positions, directions = _along_x([(-2.0, 0.25 * math.sqrt(1 - s * s), 0.0) for s in SLOPES], dtype)
    positions, directions = positions.double(), directions.double()
    half = _sine(4 * positions[:, 1]) / 4
    assert_within(_cast(_closed_form.Torus(0.75, 0.25), positions, directions).depth, 1.25 - half, 1e-7)


def test_a_ray_that_touches_a_sphere_hits_and_one_an_epsilon_above_misses(dtype):
    positions, directions = _along_x([(-2.0, 1.0, 0.0), (-2.0, 1.0 + step(dtype), 0.0)], dtype)
    assert_exact(_cast(primitives.Sphere(), positions, directions).depth, [2.0, math.inf])


def test_rays_in_a_plane_and_parallel_to_it_miss(dtype):
    positions, directions = _along_x([(0.0, 0.0, 0.0), (0.0, 1e-7, 0.0), (0.0, -1e-7, 0.0)], dtype)
    hits = _cast(_closed_form.Plane(), positions, directions)
    assert_exact(hits.depth, [math.inf] * 3)
    assert_exact(hits.normals, torch.zeros(3, 3))


def test_starts_on_a_sphere_and_beside_it_count_from_zero(dtype):
    """x = 1, 1 + 1e-7, 1 - 1e-7: 0 on it; beside it the gap to the near side, the rest of the diameter, or a miss."""
    x = torch.tensor([1.0, 1.0 + 1e-7, 1.0 - 1e-7], dtype=torch.float64).to(dtype)
    positions = torch.stack((x, torch.zeros_like(x), torch.zeros_like(x)), dim=-1).repeat(2, 1)
    directions = torch.tensor([1.0, 0.0, 0.0], dtype=dtype).expand(3, 3)
    hits = _cast(primitives.Sphere(), positions, torch.cat((directions, -directions)))
    x = x.double()
    expected = torch.tensor([0.0, math.inf, 1 - x[2], 0.0, x[1] - 1, 1 + x[2]])
    assert_within(hits.depth, expected, 2 * step(dtype))


def test_no_leak_from_the_centre_through_corners_and_edges_of_a_box(dtype):
    expected = TARGETS.norm(dim=-1).repeat(2)
    directions = lattice_rays(dtype)[1][: len(expected)]
    hits = _cast(primitives.Box(), torch.zeros_like(directions), directions)
    assert_within(hits.depth, expected, 4 * step(dtype))


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


def test_starts_at_the_ends_of_float16_hit_a_sphere(dtype):
    ends = torch.tensor([65504.0, -65504.0, 2.0**-24, -(2.0**-24)], dtype=torch.float16).to(dtype)
    zero = torch.zeros_like(ends)
    directions = torch.stack((-ends.sign(), zero, zero), dim=-1)
    hits = _cast(primitives.Sphere(), torch.stack((ends, zero, zero), dim=-1), directions)
    assert_within(hits.depth, [65503.0, 65503.0, 1 + 2.0**-24, 1 + 2.0**-24], step(dtype) / 2)


@pytest.mark.parametrize("length", [0.0, 0.9998, 1.0002, 2.0])
def test_directions_that_are_not_unit_are_refused(length, dtype):
    direction = torch.tensor([[0.6 * length, 0.8 * length, 0.0]], dtype=dtype)
    rule = rf"directions must be unit length \(tol 0\.0001\); got {length:g} at index \(0,\)"
    assert_refused(lambda: rays.OrientedPoints(torch.zeros_like(direction), direction), rule)


def test_directions_rounded_to_float16_are_refused_and_those_off_by_1e_5_kept(dtype):
    rounded = torch.full((1, 3), 3**-0.5, dtype=torch.float16).to(dtype)
    assert_refused(lambda: rays.OrientedPoints(torch.zeros_like(rounded), rounded), "unit length .* got 0.99965")
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
    hits = _cast(primitives.Sphere(), nothing, nothing)
    found = (hits.depth, hits.normals, *rays.enter_box(nothing, nothing, -one, one))
    assert [tuple(t.shape) for t in found] == [(0,), (0, 3), (0, 3), (0,), (0,)]

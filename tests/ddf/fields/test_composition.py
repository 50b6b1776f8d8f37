"""Scenes of several fields: against closed forms and a slow loop over the paper's formulas."""

import dataclasses
import math

import _closed_form
import _models
import numpy as np
import pytest
import torch
from _hard import assert_exact, assert_within, step
from _shapes import random_rays
from _support import assert_close

from ddf.core import checks
from ddf.fields import composition, pddf
from ddf.geometry import primitives, rays, transforms

TEMPERATURE, INVERSE_DEPTH = 1e-4, 0.05


def _turn(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    turn = np.eye(3)
    i, j = [k for k in range(3) if k != axis]
    turn[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return turn


def _placed(shape, scale=1.0, rotation=None, at=(0.0, 0.0, 0.0)):
    """A primitive of the unit cube, scaled, turned, then moved; returns it with its map to the world."""
    world = transforms.Similarity(scale, np.eye(3) if rotation is None else rotation, np.array(at))

    def query(positions, directions):
        depth, _ = shape.first(positions, directions)
        return torch.isfinite(depth).to(depth), depth

    return composition.Placed(query, world.inverse())


def _fixed(visibility, depth, at=(0.0, 0.0, 0.0)):
    """A field of the cube around `at` that says the same everywhere."""
    return composition.Placed(
        lambda p, _: (torch.full_like(p[:, 0], visibility), torch.full_like(p[:, 0], depth)),
        transforms.Similarity(1.0, np.eye(3), np.array(at)).inverse(),
    )


SPHERE = primitives.Sphere(radius=0.8)
SCENE = [
    _placed(SPHERE, 0.5, None, (0.3, 0.1, -0.6)),
    _placed(_closed_form.Torus(), 0.7, _turn(0, 0.7) @ _turn(1, 0.4), (-0.8, 0.2, 0.3)),
    _placed(primitives.Box((-0.9, -0.4, -0.6), (0.5, 0.7, 0.8)), 0.4, _turn(2, 1.1), (0.7, -0.7, 0.5)),
]


def _compose(objects, points, temperature=TEMPERATURE, inverse_depth=INVERSE_DEPTH):
    return composition.compose(objects, points.positions, points.directions, temperature, inverse_depth)


def test_scaled_and_moved_spheres_equal_the_union_in_the_world():
    one, other = _placed(SPHERE, 0.5, _turn(1, 0.3), (0.7, 0.1, 0)), _placed(SPHERE, 0.25, _turn(0, 2), (-0.6, 0, 0.2))
    truth = primitives.Union((primitives.Sphere((0.7, 0.1, 0.0), 0.4), primitives.Sphere((-0.6, 0.0, 0.2), 0.2)))
    points = random_rays(4000, seed=1, spread=1.2)
    hits, found = primitives.cast(truth, points), _compose([one, other], points)
    assert 100 < hits.visible.sum() < 3900
    assert_close(found.visibility, hits.visible.double())
    assert_close(found.nearest_depth, hits.depth)
    assert_close(torch.isfinite(found.depth), hits.visible)


def test_soft_depth_is_the_paper_s_sum_over_the_objects_whose_box_is_met():
    points = random_rays(500, seed=3, spread=1.5)
    seen = [0.9, 0.6, 0.2]
    asked = [lambda p, v, s=s: (torch.full_like(p[:, 0], s), 0.3 + p.norm(dim=-1)) for s in seen]
    objects = [dataclasses.replace(placed, query=query) for placed, query in zip(SCENE, asked, strict=True)]
    found = _compose(objects, points, temperature=0.3, inverse_depth=0.2)
    for i, (p, v) in enumerate(zip(points.positions, points.directions, strict=True)):
        visible, depths = [], []
        for placed, s in zip(objects, seen, strict=True):
            transform = placed.field_from_world
            inner, looking = (
                torch.from_numpy(f(x.numpy())) for f, x in ((transform.apply, p), (transform.apply_directions, v))
            )
            entry, leave = rays.box_span(inner, looking, torch.full_like(p, -1), torch.full_like(p, 1))
            if entry <= leave:
                visible.append(s)
                depths.append(float(entry + 0.3 + (inner + entry * looking).norm()) / transform.scale)
        assert found.visibility[i].item() == pytest.approx(1 - math.prod(1 - s for s in visible))
        if not depths:
            assert found.depth[i] == torch.inf and found.nearest_depth[i] == torch.inf
            continue
        powers = [math.exp(s / (0.3 * (0.2 + d))) for s, d in zip(visible, depths, strict=True)]
        expected = sum(a * d for a, d in zip(powers, depths, strict=True)) / sum(powers)
        assert found.depth[i].item() == pytest.approx(expected, rel=1e-9)
        nearest = min((d for s, d in zip(visible, depths, strict=True) if s >= 0.5), default=math.inf)
        assert found.nearest_depth[i].item() == pytest.approx(nearest)


def test_soft_depth_goes_to_the_nearest_as_the_temperature_falls():
    points = random_rays(3000, seed=4, spread=2.0)
    errors = []
    for temperature in (0.1, 0.01, 1e-5):
        found = _compose(SCENE, points, temperature=temperature)
        hit = torch.isfinite(found.depth)
        errors.append((found.depth - found.nearest_depth)[hit].abs().mean().item())
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert errors[2] < 1e-3


@pytest.mark.parametrize("networks", [False, True])
def test_fields_are_asked_inside_their_boxes_and_their_order_does_not_matter(networks):
    objects = SCENE
    if networks:
        field = _models.field()

        def query(positions, directions):
            raw = field(positions.float(), directions.float(), None)
            return pddf.visibility(raw), field.depth(raw)

        objects = [dataclasses.replace(placed, query=query) for placed in SCENE]
    points = random_rays(2000, seed=6, spread=2.0)
    one, other = _compose(objects, points, 0.05), _compose(objects[::-1], points, 0.05)
    assert_close(one.visibility, other.visibility, atol=1e-6)
    assert_close(one.depth, other.depth, atol=1e-6)
    assert_close(one.nearest_depth, other.nearest_depth, atol=1e-6)
    assert 0 < other.queries == one.queries < 3000


def test_depth_gradient_is_that_of_the_spheres():
    points = random_rays(1000, seed=7, spread=1.5)
    positions = points.positions.clone().requires_grad_()
    objects = [_placed(SPHERE, 0.5, _turn(1, 0.3), (0.7, 0.1, 0.0)), _placed(SPHERE, 0.5, None, (-0.6, 0.0, 0.2))]
    found = composition.compose(objects, positions, points.directions, 1e-9, INVERSE_DEPTH)
    hit = torch.isfinite(found.depth)
    (gradient,) = torch.autograd.grad(found.depth[hit].sum(), positions)
    slope = (gradient * points.directions).sum(-1)
    assert hit.sum() > 20
    assert_close(slope[hit], torch.full_like(slope[hit], -1.0), atol=1e-6)
    assert_close(slope[~hit], torch.zeros_like(slope[~hit]))


@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
@pytest.mark.parametrize("name", ["temperature", "inverse_depth"])
def test_constants_must_be_positive_and_finite(name, value):
    with pytest.raises(checks.InputError, match=f"{name} must be positive and finite; got {value}"):
        _compose(SCENE, random_rays(1, seed=0), **{name: value})


def test_empty_scene_and_empty_box_are_refused():
    with pytest.raises(checks.InputError, match="at least one object; got none"):
        _compose([], random_rays(1, seed=0))
    with pytest.raises(checks.InputError, match="lower must be below upper"):
        dataclasses.replace(SCENE[0], lower=(1.0, -1.0, -1.0))


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

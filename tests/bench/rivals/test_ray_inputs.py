"""What peers read of a ray, the same for every point of a line; and fields of rays, which learn a ball from it."""

import dataclasses
import functools

import _shapes
import pytest
import torch

from bench.rivals import ray_fields
from ddf.fit import fit_settings
from ddf.geometry import primitives, rays

LOWER, UPPER = torch.tensor([-0.8, -0.7, -0.9]).double(), torch.tensor([0.8, 0.7, 0.9]).double()
BALL, REACH = 0.6, float(torch.tensor([0.8, 0.7, 0.9]).double().norm())
READS = {
    "box entry": functools.partial(ray_fields.box_entry, lower=LOWER, upper=UPPER),
    "foot": functools.partial(ray_fields.foot, radius=REACH),
}


def _rays(count=500):
    """From outside, those that meet the ball and do not graze it, and what they see."""
    drawn = _shapes.random_rays(count, seed=5)
    starts = 2.5 * torch.nn.functional.normalize(drawn.positions, dim=-1)
    directions = torch.nn.functional.normalize(0.4 * drawn.directions - starts, dim=-1)
    truth = primitives.cast(primitives.Sphere(radius=BALL), rays.OrientedPoints(starts, directions))
    clear = truth.visible & ((truth.normals * directions).sum(-1) < -0.1)
    assert int(clear.sum()) > 200
    return starts[clear], directions[clear], truth.depth[clear], truth.normals[clear]


def _ball(x, name):
    """f(x) of the ball, from the six numbers alone: what a perfect network would say."""
    point, v = x[:, :3], x[:, 3:]
    along = (point * v).sum(-1)
    to_ball = -along - (along.square() - point.square().sum(-1) + BALL**2).sqrt()
    return to_ball if name == "box entry" else to_ball + REACH


@pytest.mark.parametrize("name", READS)
def test_the_six_numbers_tell_the_depth_of_a_ball(name):
    p, v, depth, _ = _rays()
    x, before = READS[name](p, v)
    assert x.shape == (len(p), 6)
    f = _ball(x, name)
    assert bool((f >= 0).all())
    torch.testing.assert_close(before + f, depth, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", READS)
def test_any_point_of_a_line_is_the_same_ray(name):
    p, v, _, _ = _rays()
    x, before = READS[name](p, v)
    same, moved = READS[name](p + 0.3 * v, v)  # still outside
    torch.testing.assert_close(same, x, rtol=0, atol=1e-9)
    torch.testing.assert_close(moved, before - 0.3, rtol=0, atol=1e-9)


def _section():
    section = fit_settings.FitConfig()
    field = dataclasses.replace(section.field, hidden=(32, 32))
    return dataclasses.replace(section, field=field, loop=dataclasses.replace(section.loop, threads=1))


def _seen(count, seed):
    """Rays from outside that meet the box."""
    drawn = _shapes.random_rays(count, seed=seed)
    starts = 2.5 * torch.nn.functional.normalize(drawn.positions, dim=-1)
    directions = torch.nn.functional.normalize(0.8 * drawn.directions - starts, dim=-1)
    meets = rays.enter_box(starts, directions, LOWER, UPPER)[2]
    truth = primitives.cast(primitives.Sphere(radius=BALL), rays.OrientedPoints(starts[meets], directions[meets]))
    return ray_fields.SeenRays(starts[meets].float(), directions[meets].float(), truth)


def test_a_small_network_learns_a_ball_and_sees_nothing_behind():
    field = ray_fields.fit(READS["foot"], [_seen(2_500, 0), _seen(2_500, 2)], _section(), 512, 300)
    held_out = _seen(500, 1)
    with torch.no_grad():
        depth = field.depth(held_out.positions, held_out.directions)
        normals = field.normals(held_out.positions, held_out.directions)
    truth = held_out.truth
    both = torch.isfinite(depth) & truth.visible
    assert float((torch.isfinite(depth) != truth.visible).float().mean()) < 0.15
    assert float((depth - truth.depth)[both].abs().median()) < 0.05
    assert float((normals * truth.normals).sum(-1)[both].median()) > 0.95
    p, v = torch.tensor([[0.0, 0.0, 2.0], [0.0, 0.0, 0.0]]), torch.tensor([[0.0, 0.0, -1.0]]).repeat(2, 1)
    with torch.no_grad():
        depth = field.depth(p, v)  # the second begins at the centre: its line first meets the ball behind
    assert float(depth[0]) == pytest.approx(2 - BALL, abs=0.15) and float(depth[1]) == float("inf")

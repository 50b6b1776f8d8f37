"""Fields of rays learn a ball whichever way they read rays, and say nothing of what lies behind; steps for a time."""

import dataclasses
import itertools
import time

import _shapes
import pytest
import torch

from bench.lib import measuring
from bench.rivals import ray_fields
from ddf.fields import derivatives, pddf
from ddf.fit import fit_settings
from ddf.geometry import primitives, rays

BALL, SIDE = 0.6, 0.7
CORNER = torch.full((3,), SIDE)
READS = {
    "box entry": ray_fields.BoxEntry(-CORNER, CORNER),
    "plucker": ray_fields.Plucker(float(CORNER.norm())),
    "two spheres": ray_fields.TwoSpheres(float(CORNER.norm())),
    "foot": ray_fields.Foot(float(CORNER.norm())),
}


def _section() -> fit_settings.FitConfig:
    section = fit_settings.FitConfig()
    field = dataclasses.replace(section.field, hidden=(32, 32))
    return dataclasses.replace(section, field=field, loop=dataclasses.replace(section.loop, threads=1))


def _seen(count: int, seed: int) -> ray_fields.SeenRays:
    """Rays from outside that meet the box."""
    drawn = _shapes.random_rays(count, seed=seed)
    starts = 2.5 * torch.nn.functional.normalize(drawn.positions, dim=-1)
    directions = torch.nn.functional.normalize(0.8 * drawn.directions - starts, dim=-1)
    meets = rays.enter_box(starts, directions, -CORNER.double(), CORNER.double())[2]
    truth = primitives.cast(primitives.Sphere(radius=BALL), rays.OrientedPoints(starts[meets], directions[meets]))
    return ray_fields.SeenRays(starts[meets].float(), directions[meets].float(), truth)


@pytest.mark.parametrize("name", READS)
def test_normals_are_those_of_the_depth(name):
    """Of a network as it is made, against autograd through all of it."""
    torch.manual_seed(0)
    field = ray_fields.RayField(pddf.PDDF(_section().field), READS[name])
    seen = _seen(300, 1)
    p, v = seen.positions.requires_grad_(), seen.directions
    x, before = READS[name].read(p, v)
    depth = before + field.network.depth(field.network.network(x))
    (gradient,) = torch.autograd.grad(depth.sum(), p)
    truth = derivatives.normals(gradient, v)
    with torch.no_grad():
        torch.testing.assert_close(field.normals(p, v), truth, rtol=0, atol=1e-4)
        shown = field.depth(p, v)
    assert bool(((shown == depth) | torch.isinf(shown)).all())


def test_a_small_network_learns_a_ball_and_sees_nothing_behind():
    field = ray_fields.fit(READS["foot"], [_seen(5_000, 0)], _section(), 512, 300)
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


def test_every_set_of_rays_has_its_share_and_a_seed_decides():
    first, second = _seen(500, 0), _seen(500, 1)
    one, again = (ray_fields.fit(READS["foot"], [first, second], _section(), 64, 3) for _ in range(2))
    other = ray_fields.fit(READS["foot"], [first], _section(), 64, 3)
    for a, b in zip(one.network.parameters(), again.network.parameters(), strict=True):
        assert torch.equal(a, b)
    assert not torch.equal(one.network.network.head.weight, other.network.network.head.weight)


def test_steps_fill_the_seconds_with_what_comes_before_them(monkeypatch):
    """A training of 2 s and 0.1 s a step, by a clock that it moves itself."""
    clock = itertools.count()
    now = {"seconds": 0.0}
    monkeypatch.setattr(time, "process_time", lambda: now["seconds"])

    def train(steps):
        next(clock)
        now["seconds"] += 2.0 + 0.1 * steps

    assert abs(measuring.steps_within(train, 12.0) - 100) <= 1
    assert measuring.steps_within(train, 0.1) == 1
    assert next(clock) == 6


def test_a_training_that_takes_no_time_has_no_number_of_steps(monkeypatch):
    monkeypatch.setattr(time, "process_time", lambda: 0.0)
    with pytest.raises(RuntimeError, match="too few to tell"):
        measuring.steps_within(lambda steps: None, 1.0)

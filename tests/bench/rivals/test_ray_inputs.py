"""What peers read of a ray: the same for every point of a line, and the closed-form normal of a sphere from each."""

import _shapes
import pytest
import torch

from bench.rivals import ray_fields
from ddf.geometry import primitives, rays

LOWER, UPPER = torch.tensor([-0.8, -0.7, -0.9]).double(), torch.tensor([0.8, 0.7, 0.9]).double()
BALL, REACH = 0.6, float(torch.tensor([0.8, 0.7, 0.9]).double().norm())
READS = {
    "box entry": ray_fields.BoxEntry(LOWER, UPPER),
    "plucker": ray_fields.Plucker(REACH),
    "two spheres": ray_fields.TwoSpheres(REACH),
    "foot": ray_fields.Foot(REACH),
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


def _ball(reads, x, name):
    """f(x) of the ball, from the six numbers alone: what a perfect network would say."""
    first, second = x[:, :3], x[:, 3:]
    if name == "two spheres":
        v = torch.nn.functional.normalize(second - first, dim=-1)
        point = first
    else:
        v = second
        point = torch.linalg.cross(v, first) if name == "plucker" else first
    along = (point * v).sum(-1)
    to_ball = -along - (along.square() - point.square().sum(-1) + BALL**2).sqrt()
    return to_ball if name in ("two spheres", "box entry") else to_ball + reads.radius


@pytest.mark.parametrize("name", READS)
def test_the_six_numbers_tell_the_depth_of_a_ball(name):
    p, v, depth, _ = _rays()
    x, before = READS[name].read(p, v)
    assert x.shape == (len(p), 6)
    f = _ball(READS[name], x, name)
    assert bool((f >= 0).all())
    torch.testing.assert_close(before + f, depth, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", READS)
def test_any_point_of_a_line_is_the_same_ray(name):
    p, v, _, _ = _rays()
    x, before = READS[name].read(p, v)
    same, moved = READS[name].read(p + 0.3 * v, v)  # still outside
    torch.testing.assert_close(same, x, rtol=0, atol=1e-9)
    torch.testing.assert_close(moved, before - 0.3, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", READS)
def test_gradient_gives_the_normals_of_a_ball_and_falls_along_the_ray(name):
    reads = READS[name]
    p, v, _, normals = _rays()
    x = reads.read(p, v)[0].requires_grad_()
    (slope,) = torch.autograd.grad(_ball(reads, x, name).sum(), x)
    gradient = reads.gradient(p, v, slope)
    torch.testing.assert_close((gradient * v).sum(-1), torch.full((len(p),), -1.0).double(), rtol=0, atol=1e-9)
    torch.testing.assert_close(torch.nn.functional.normalize(gradient, dim=-1), normals, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", READS)
def test_gradient_is_that_of_any_network(name):
    """Of one that knows nothing of lines, against autograd."""
    reads = READS[name]
    p, v, _, _ = _rays()
    weights = torch.linspace(-1, 1, 6).double()
    p = p.requires_grad_()
    x, before = reads.read(p, v)
    depth = before + torch.sin(x * 2 @ weights)
    (truth,) = torch.autograd.grad(depth.sum(), p)
    x = x.detach().requires_grad_()
    (slope,) = torch.autograd.grad(torch.sin(x * 2 @ weights).sum(), x)
    torch.testing.assert_close(reads.gradient(p.detach(), v, slope), truth, rtol=0, atol=1e-8)


def test_inside_the_box_ours_reads_the_point_itself():
    drawn = _shapes.random_rays(50, seed=1, spread=0.6)
    reads = READS["box entry"]
    x, before = reads.read(drawn.positions, drawn.directions)
    torch.testing.assert_close(x, torch.cat((drawn.positions, drawn.directions), dim=-1))
    assert not bool(before.any())
    slope = torch.randn(50, 6, generator=torch.Generator().manual_seed(0)).double()
    torch.testing.assert_close(reads.gradient(drawn.positions, drawn.directions, slope), slope[:, :3])

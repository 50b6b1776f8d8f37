"""The rival that a render is timed against has to be right: sphere tracing."""

import _shapes
import torch

from bench.rivals import distances
from ddf.geometry import primitives, rays

RADIUS = 0.6
LOWER, UPPER = torch.full((3,), -0.65), torch.full((3,), 0.65)
LONG = distances.Tracing(max_steps=200, threshold=1e-5, within=1e-5, chunk=128)


def _sphere(points):
    return points.norm(dim=-1) - RADIUS


def _rays(count=600):
    drawn = _shapes.random_rays(count, seed=3)
    starts = 3 * torch.nn.functional.normalize(drawn.positions, dim=-1)
    directions = torch.nn.functional.normalize(0.9 * drawn.directions - starts, dim=-1)
    depth = primitives.cast(primitives.Sphere(radius=RADIUS), rays.OrientedPoints(starts, directions)).depth
    return starts.float(), directions.float(), depth.float()


def test_exact_distances_give_the_closed_form_depth():
    starts, directions, truth = _rays()
    depth, _ = distances.trace(_sphere, starts, directions, LOWER, UPPER, LONG)
    offset = torch.linalg.cross(starts, directions).norm(dim=-1)  # of the ray from the centre
    clear = (offset - RADIUS).abs() > 1e-3
    assert 50 < int(torch.isfinite(truth).sum()) < 550
    torch.testing.assert_close(depth[clear], truth[clear], rtol=0, atol=1e-3)
    steep = offset < 0.5 * RADIUS
    torch.testing.assert_close(depth[steep], truth[steep], rtol=0, atol=3e-5)


def test_rays_that_miss_the_box_cost_nothing():
    starts, directions, _ = _rays()
    asked = []

    def counted(points):
        asked.append(len(points))
        assert bool((points.abs() <= 0.65 + 1e-5).all())
        return _sphere(points)

    entry, leave = rays.box_span(starts, directions, LOWER, UPPER)
    _, once = distances.trace(counted, starts, directions, LOWER, UPPER, distances.Tracing(1, 1e-5, 1e-5))
    assert once == sum(asked) == int((entry <= leave).sum()) < len(starts)
    _, none = distances.trace(counted, starts, -directions, LOWER, UPPER, LONG)
    assert none == 0

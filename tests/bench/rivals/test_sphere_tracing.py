"""The rival that a render is timed against has to be right: sphere tracing, and the distances that it marches on."""

import _shapes
import numpy as np
import torch

from bench.rivals import distances
from ddf.fields import siren
from ddf.geometry import primitives, raycast, rays
from ddf.models import loop_config

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


def test_a_ray_out_of_steps_counts_only_within_its_tolerance():
    start, along = torch.tensor([[0.0, 0.0, 2.0]]), torch.tensor([[0.0, 0.0, -1.0]])
    half_as_far = lambda points: 0.5 * _sphere(points)  # noqa: E731
    for within, hits in ((1e-3, False), (0.02, True)):
        how = distances.Tracing(2, 1e-5, within)  # f: 0.025, then 0.0125
        depth, queries = distances.trace(half_as_far, start, along, LOWER, UPPER, how)
        assert bool(torch.isfinite(depth[0])) is hits
        assert queries == 2


def test_signed_distances_of_a_mesh_are_those_of_its_sphere():
    points = np.random.default_rng(0).uniform(-1, 1, (500, 3))
    found = distances.signed_distances(raycast.Scene(_shapes.icosphere(5)), points)
    np.testing.assert_allclose(found, np.linalg.norm(points, axis=1) - 1, atol=1e-3)


def test_a_trained_network_traces_the_sphere():
    loop = loop_config.LoopConfig(5e-3, "cosine", 10, 1.0, 1, 0, 50, 1e9)
    config = distances.DistanceConfig(siren.SineLayout((32, 32), 3.0), loop, points=20_000, batch=512)
    network = distances.fit_distance(_shapes.icosphere(3, RADIUS), config, steps=300)
    starts, directions, truth = _rays()
    how = distances.Tracing(64, 1e-3, 1e-2)
    with torch.no_grad():
        depth, _ = distances.trace(lambda p: network(p).squeeze(-1), starts, directions, LOWER, UPPER, how)
    both = torch.isfinite(depth) & torch.isfinite(truth)
    assert float(both.float().mean()) > 0.9 * float(torch.isfinite(truth).float().mean())
    assert float((depth - truth)[both].abs().median()) < 0.02

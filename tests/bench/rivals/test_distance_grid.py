"""The rival of patches has to be right: distances on a grid, and what rays meet through it."""

import _shapes
import numpy as np
import pytest
from _support import assert_close

from bench.data import ray_casting
from bench.rivals import distances
from ddf.geometry import primitives, raycast, rays

SPHERE = ray_casting.sphere(20_000)  # of radius 1, to 1e-3
GRID = distances.on_grid(raycast.Scene(SPHERE), 48)


def test_samples_are_exact_near_the_surface_and_lower_bounds_beyond():
    places = np.moveaxis(np.indices(GRID.samples.shape), 0, -1) * GRID.voxel + GRID.lower
    truth = np.linalg.norm(places, axis=-1) - 1
    near = np.abs(truth) < 2 * GRID.voxel
    assert GRID.samples.shape == (49, 49, 49) and GRID.samples.dtype == np.float32
    assert np.abs(GRID.samples - truth)[near].max() < 1e-3
    assert np.array_equal(GRID.samples[~near] < 0, truth[~near] < 0)
    assert (np.abs(GRID.samples) <= np.abs(truth) + 1e-3).all() and np.abs(GRID.samples).max() > 0.4


@pytest.mark.parametrize("spread", [0.55, 1.5], ids=["inside", "inside and outside"])
def test_rays_meet_the_sphere_from_either_side(spread):
    drawn = _shapes.random_rays(4000, 1, spread)
    truth = primitives.cast(primitives.Sphere(radius=1.0), drawn)
    points = rays.OrientedPoints(drawn.positions.numpy(), drawn.directions.numpy())
    depth, normals = GRID.cast(points)
    seen, normal = np.isfinite(truth.depth.numpy()), truth.normals.numpy()
    far = truth.depth.numpy() > GRID.voxel  # nearer ones start on the surface
    steep = seen & far & (np.abs((normal * points.directions).sum(axis=1)) > 0.2)
    assert (np.isfinite(depth) == seen).mean() > 0.99 and np.isfinite(depth[steep]).all()
    assert_close(depth[steep], truth.depth.numpy()[steep], atol=1e-2, rtol=0.0)  # h²/8 between samples, over the slope
    assert_close(normals[steep], normal[steep], atol=0.05, rtol=0.0)
    assert steep.sum() > 1000 and seen.all() == (spread < 1)


def test_rays_that_start_on_the_surface_leave_it():
    starts = np.random.default_rng(2).standard_normal((500, 3))
    starts /= np.linalg.norm(starts, axis=1, keepdims=True)
    for way in (1.0, -1.0):
        depth, _ = GRID.cast(rays.OrientedPoints(starts, way * starts))
        truth = np.full(500, np.inf if way > 0 else 2.0)  # away, or through the middle
        assert_close(depth, truth, atol=2e-3, rtol=0.0)

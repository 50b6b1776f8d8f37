"""Samples of measured rays: each says what an exact ray from there meets; a network fitted to them is the shape."""

import dataclasses

import numpy as np
import pytest
from _sphere_scan import RADIUS, sphere_scan
from _tiny_fits import SPHERE

from ddf.core import checks
from ddf.data.samples import extraction, sample_types
from ddf.fields import framed_field, shape_field
from ddf.fit import fitting, shape_samples
from ddf.geometry import mesh_io, rays, scans, transforms

SCALE = 0.4
FRAME = transforms.Similarity(SCALE, np.eye(3), np.array([0.1, 0.0, -0.2]))
CORNERS = FRAME.translation + SCALE * RADIUS * np.array([[-1.0] * 3, [1] * 3, [1, -1, 1]])
BOX = mesh_io.Mesh(CORNERS, np.array([[0, 1, 2]]))
DRAWN = extraction.SamplesConfig(sample_types.each(1), 0.05, "fixed", "tight", 0.02)


def test_samples_of_exact_rays_are_exact():
    """Of a sphere: visible ones end on it where they say, and what is not visible misses it."""
    found = shape_samples.draw_from_rays(sphere_scan(24), BOX, FRAME, DRAWN, 4000)
    part = {name: values.astype(np.float64) for name, values in found.arrays[shape_samples.RAY_KIND].items()}
    start, way, visible = part["positions"] - FRAME.translation, part["directions"], part["visible"] > 0
    assert 0.2 < visible.mean() < 0.95 and (part["depth"][visible] > 0).all() and (part["depth"][~visible] == 0).all()
    assert (part["positions"] >= found.lower - 1e-6).all() and (part["positions"] <= found.upper + 1e-6).all()
    end = start + part["depth"][:, None] * way
    assert np.abs(np.linalg.norm(end[visible], axis=1) - SCALE * RADIUS).max() < 1e-6
    assert (np.linalg.norm(start[visible], axis=1) > SCALE * RADIUS - 1e-6).all()
    across = np.linalg.norm(start - (start * way).sum(axis=1, keepdims=True) * way, axis=1)
    assert (across[~visible] > SCALE * RADIUS - 1e-6).all()


def test_rays_that_end_before_the_box_tell_nothing():
    scan = sphere_scan(8)
    near = scans.Scan(scan.positions, scan.directions, np.full(len(scan.ranges), 1e-3))
    with pytest.raises(checks.InputError, match="no ray crosses the box"):
        shape_samples.draw_from_rays(near, BOX, FRAME, DRAWN, 10)


def test_a_network_fitted_to_rays_alone_is_the_sphere(tmp_path):
    config = dataclasses.replace(SPHERE, steps=300)
    result = fitting.fit(sphere_scan(24), config, tmp_path)
    ways = np.random.default_rng(0).standard_normal((500, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    asked = rays.OrientedPoints(-1.5 * RADIUS * ways, ways)
    depth = framed_field.query(shape_field.load(tmp_path), asked, ("depth",))[0]["depth"]
    assert np.isfinite(depth).mean() > 0.98 and np.nanmedian(np.abs(depth - 0.5 * RADIUS)) < 0.08 * RADIUS
    assert result["held_out"]["depth_median"] < 0.05 and result["steps"] == 300

"""The surface of measured rays against closed forms: a sphere and a plane."""

import numpy as np
import pytest
from _sphere_scan import RADIUS, sphere_scan

from ddf.core import checks
from ddf.geometry import fused_rays, raycast, scans

PLANE = np.random.default_rng(1).uniform(-1, 1, (20_000, 3)) * [1, 1, 0]


def radii(fused: fused_rays.Fused) -> np.ndarray:
    """Of the vertices of the surface."""
    return np.linalg.norm(fused.mesh.vertices, axis=1)


def test_sphere_is_exact_without_noise() -> None:
    fused = fused_rays.fuse(sphere_scan(16))
    assert np.abs(radii(fused) - RADIUS).max() < 0.1 * fused.cell  # sagitta of a cell: r - sqrt(r² - h²)
    assert fused.noise < 0.1 * fused.cell


@pytest.mark.parametrize(("views", "outliers", "most"), [(32, 0.0, 2), (32, 0.02, 2), (128, 0.02, 2.5)])
def test_noise_of_many_rays_is_averaged_and_told(views: int, outliers: float, most: float) -> None:
    noise = 0.02
    fused = fused_rays.fuse(sphere_scan(views, noise, outliers))
    assert 0.5 * noise < fused.noise < 1.1 * noise
    off = radii(fused) - RADIUS
    assert np.median(np.abs(off)) < 0.25 * noise
    assert np.abs(off).max() < most * noise  # no outlier left a speck


def test_sphere_is_closed_and_faces_outwards() -> None:
    fused = fused_rays.fuse(sphere_scan(32, 0.01))
    scene, random = raycast.Scene(fused.mesh), np.random.default_rng(0)
    ways = random.standard_normal((2000, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    depth, face = scene.first_hits(np.zeros_like(ways), ways)
    assert (np.abs(depth - RADIUS) < 0.02).all()
    assert ((scene.normals[face] * ways).sum(axis=1) > 0.5).all()


def test_evidence_is_what_rays_passed_through() -> None:
    fused = fused_rays.fuse(sphere_scan(16))
    cells = np.array([[0.0, 0, 0], [0.9 * RADIUS, 0.9 * RADIUS, 0], [RADIUS, 0, 0]]) - 0.01
    passed, ended = fused.evidence(cells, 0.02)
    assert passed.tolist()[:2] == [False, True]
    assert ended.tolist() == [False, False, True]


def test_plane_seen_from_one_side_stays_open() -> None:
    eye = np.array([0.0, 0, 2])
    fused = fused_rays.fuse(scans.of_points(PLANE, eye))
    inner = np.abs(fused.mesh.vertices[:, :2]).max(axis=1) < 0.9
    assert np.abs(fused.mesh.vertices[inner, 2]).max() < 0.5 * fused.cell  # but where what is behind the rim begins
    passed, _ = fused.evidence(np.array([[0, 0, 0.05], [0, 0, -0.05]]), 0.01)
    assert passed.tolist() == [True, False]


def test_points_without_sensors_close_nothing() -> None:
    down = np.broadcast_to([0.0, 0, -1], PLANE.shape)
    fused = fused_rays.fuse(scans.Scan(PLANE - 0.02 * down, down, np.full(len(PLANE), 0.02)), sensed=False)
    assert np.abs(fused.mesh.vertices[:, 2]).max() < 1e-9


def test_hits_that_are_no_surface_are_refused_by_their_reason() -> None:
    parts, down = np.random.default_rng(1).uniform(-1, 1, (500, 3)), np.tile([0.0, 0, -1], (500, 1))
    for ranges, side, told in (
        (np.inf, [1, 1, 0], "0 hits: too few for a surface"),
        (1.0, [0, 0, 0], "the 500 hits span nothing"),
        (1.0, [1, 0, 0], "the 500 hits span nothing"),
        (1.0, [1, 1, 0], "have 3 others within .*: too far apart for a surface"),
    ):
        with pytest.raises(checks.InputError, match=told):
            fused_rays.fuse(scans.Scan(0.1 + parts * side, down, np.full(500, ranges)))

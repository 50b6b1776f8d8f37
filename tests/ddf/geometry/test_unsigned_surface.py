"""Meshes of unsigned distances: spheres to second order, sheets with their rims, two sheets apart, nothing."""

import numpy as np
import pytest
import trimesh

from ddf.core import checks
from ddf.geometry import unsigned_surface

SIDE = np.ones(3)


def _sphere(radius=0.8, centre=(0.0, 0.0, 0.0)):
    def ask(positions):
        away = positions - np.array(centre)
        length = np.linalg.norm(away, axis=1)
        unit = away / np.maximum(length, 1e-12)[:, None]
        return np.abs(length - radius), -np.sign(length - radius)[:, None] * unit

    return ask


def _square(half=0.6, height=0.013):
    def ask(positions):
        closest = np.clip(positions, [-half, height, -half], [half, height, half])
        way = closest - positions
        length = np.linalg.norm(way, axis=1)
        return length, way / np.maximum(length, 1e-12)[:, None]

    return ask


def _least(*asks):
    def ask(positions):
        found = [each(positions) for each in asks]
        index = np.argmin([u for u, _ in found], axis=0)
        rows = np.arange(len(positions))
        return np.stack([u for u, _ in found])[index, rows], np.stack([v for _, v in found])[index, rows]

    return ask


def _shape(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def test_a_sphere_is_closed_and_right_to_second_order():
    errors = []
    for resolution in (16, 32, 64):
        found = unsigned_surface.extract(_sphere(), -SIDE, SIDE, resolution)
        shape = _shape(found)
        assert shape.is_watertight and shape.euler_number == 2
        np.testing.assert_allclose(np.linalg.norm(found.vertices, axis=1), 0.8, atol=1e-9)
        errors.append(4 * np.pi * 0.64 - shape.area)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.3)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2, abs=0.3)


def test_blocks_far_from_the_surface_are_not_looked_into():
    asked, ask = [], _sphere(0.3)
    unsigned_surface.extract(lambda positions: asked.append(len(positions)) or ask(positions), -SIDE, SIDE, 64)
    assert sum(asked) < 0.3 * (64 + 2 * unsigned_surface.BLOCK + 1) ** 3


def test_an_open_sheet_stays_open():
    found = unsigned_surface.extract(_square(), -SIDE, SIDE, 40)
    shape = _shape(found)
    assert not shape.is_watertight
    np.testing.assert_allclose(found.vertices[:, 1], 0.013, atol=1e-9)
    assert shape.area == pytest.approx(1.44, rel=0.12)
    assert np.abs(found.vertices[:, [0, 2]]).max() < 0.6 + 1e-9
    edges = np.sort(found.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert set(uses) == {1, 2} and (uses == 1).sum() > 40  # a rim, and no edge of three


def test_sheets_three_cells_apart_are_not_joined():
    near = _least(_square(height=0.01), _square(height=0.01 + 3 * 2 / 40))
    found = unsigned_surface.extract(near, -SIDE, SIDE, 40)
    assert len(_shape(found).split(only_watertight=False)) == 2


def test_nothing_to_extract_is_told():
    with pytest.raises(checks.InputError, match="there is no surface in the box"):
        unsigned_surface.extract(_sphere(centre=(9.0, 0.0, 0.0)), -SIDE, SIDE, 16)
    with pytest.raises(checks.InputError, match="resolution must be >= 2; got 1"):
        unsigned_surface.extract(_sphere(), -SIDE, SIDE, 1)


def test_poisson_far_from_0_gives_the_same():
    ball = trimesh.creation.icosphere(subdivisions=3)
    points, place = np.array(ball.vertices), np.array([500123.761, 4649776.48, -250.67])
    near, far = (unsigned_surface.poisson(points + shift, points, 4) for shift in (0.0, place))
    np.testing.assert_array_equal(far.faces, near.faces)
    np.testing.assert_allclose(far.vertices - place, near.vertices, rtol=0, atol=1e-4)

"""Meshes that looks from all sides leave: closed, near the surface, thin sheets kept, what no side sees full."""

import numpy as np
import pytest

from ddf.core import checks
from ddf.data import mesh_topology
from ddf.geometry import carved_surface

BOX = np.full(3, -1.0), np.full(3, 1.0)
CELLS = 40  # cells of 0.05


def _ball(starts, directions):
    towards = -(starts * directions).sum(axis=1)
    reach = 0.64 - ((starts + towards[:, None] * directions) ** 2).sum(axis=1)
    return np.where(reach >= 0, towards - np.sqrt(np.maximum(reach, 0)), np.inf)


def _sheet(starts, directions):
    """The square |x|, |y| <= 0.8 at z = 0.03, without thickness."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (0.03 - starts[:, 2]) / directions[:, 2]
        across = np.abs(starts + depth[:, None] * directions)[:, :2]
    return np.where((depth > 0) & (across <= 0.8).all(axis=1), depth, np.inf)


def test_a_ball_is_closed_and_round():
    mesh = carved_surface.extract(_ball, *BOX, CELLS)
    assert mesh_topology.is_watertight(mesh) and len(np.unique(mesh_topology.components(mesh))) == 1
    apart = np.linalg.norm(mesh.vertices, axis=1) - 0.8
    assert np.abs(apart).mean() < 0.015 and np.abs(apart).max() < 0.05
    assert mesh_topology.volumes(mesh)[0] > 0  # outward


def test_far_from_0_it_is_the_same():
    place = np.array([500123.761, 4649776.48, -250.67])
    near = carved_surface.extract(_ball, *BOX, 12)
    far = carved_surface.extract(lambda starts, ways: _ball(starts - place, ways), BOX[0] + place, BOX[1] + place, 12)
    np.testing.assert_array_equal(far.faces, near.faces)
    np.testing.assert_allclose(far.vertices - place, near.vertices, rtol=0, atol=1e-5)


def test_a_sheet_without_thickness_stays():
    mesh = carved_surface.extract(_sheet, *BOX, CELLS)
    assert mesh_topology.is_watertight(mesh)
    assert np.abs(mesh.vertices[:, 2] - 0.03).mean() < 0.03
    lower, upper = mesh.box()
    assert (lower[:2] < -0.7).all() and (upper[:2] > 0.7).all()  # two cells of its rim at most


def test_nothing_is_said():
    with pytest.raises(checks.InputError, match="nothing is left"):
        carved_surface.extract(lambda starts, _: np.full(len(starts), np.inf), *BOX, 8)

"""Sides of triangles: closed sheets outwards, openings of a cell closed, open sheets open."""

import numpy as np
import pytest
from _shapes import area_and_volume, cube, icosphere, joined, moved, torus

from ddf.fit import winding
from ddf.geometry.mesh_io import Mesh, face_normals


def _shuffled(mesh, left_out=()):
    """With sides at random, and without some triangles."""
    random = np.random.default_rng(0)
    faces = np.delete(mesh.faces, left_out, axis=0)
    return Mesh(mesh.vertices, np.where(random.random((len(faces), 1)) < 0.5, faces, faces[:, ::-1]))


@pytest.mark.parametrize(
    "mesh", [cube(), icosphere(3), torus(sections=24), joined(cube(), moved(icosphere(2), 0.3, (3.0, 0.0, 0.0)))]
)
def test_sheets_are_turned_outwards_each_by_itself(mesh):
    found = winding.told(_shuffled(mesh))
    np.testing.assert_array_equal(np.sort(found.faces), np.sort(mesh.faces))
    assert area_and_volume(found) == pytest.approx(area_and_volume(mesh))


def test_small_openings_are_closed_and_large_ones_stay():
    mesh = icosphere(3)
    corner = int(mesh.faces[100, 0])
    around = np.flatnonzero((mesh.faces == corner).any(axis=1))  # an opening of five or six edges
    found = winding.told(_shuffled(mesh, [*around, 5]))
    assert len(found.faces) == len(mesh.faces) - 2  # a fan has two triangles fewer than its opening edges
    assert area_and_volume(found)[1] == pytest.approx(area_and_volume(mesh)[1], rel=2e-3)
    half = np.flatnonzero(mesh.triangles[:, :, 1].mean(axis=1) < 0)
    bowl = winding.told(_shuffled(mesh, half))
    assert len(bowl.faces) == len(mesh.faces) - len(half)
    normals, _ = face_normals(bowl)
    assert ((normals * bowl.triangles.mean(axis=1)).sum(axis=1) > 0).all()  # the bulging side


def test_a_speck_gets_no_back_and_a_strip_of_one_side_is_cut():
    square = Mesh(cube().vertices, cube().faces[:2])
    assert len(winding.told(square).faces) == 2
    turn = 2 * np.pi * np.arange(40) / 40
    across = np.stack([np.cos(turn / 2) * np.cos(turn), np.sin(turn / 2), np.cos(turn / 2) * np.sin(turn)], axis=1)
    middle = 2 * np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=1)
    ends = np.concatenate([middle - 0.3 * across, middle + 0.3 * across])
    i, j = np.arange(40), np.roll(np.arange(40), -1)
    left, right = np.where(j == 0, 40, j), np.where(j == 0, 0, j + 40)  # the strip comes back turned
    strip = Mesh(ends, np.concatenate([np.stack([i, left, i + 40], 1), np.stack([left, right, i + 40], 1)]))
    found = winding.told(_shuffled(strip))
    edges = found.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    assert len(found.faces) == 80
    assert len(edges) - len(np.unique(edges, axis=0)) <= 2  # that two triangles go along in the same direction

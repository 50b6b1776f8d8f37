"""The unsigned distance of a scene is the least of its fields'; far fields are not asked."""

import numpy as np
import pytest
from _closed_form import ClosedForm

from ddf.fields import scene_field
from ddf.geometry import primitives, transforms

SPHERE = ClosedForm(primitives.Sphere(radius=1.0))


def _to_unit_sphere(positions):
    length = np.linalg.norm(positions, axis=-1)
    return np.abs(length - 1), np.sign(1 - length)[:, None] * positions / length[:, None]


def test_distances_and_directions_are_those_of_the_nearest_sphere():
    rng = np.random.default_rng(0)
    centres, radii = rng.uniform(-3, 3, (12, 3)), rng.uniform(0.2, 0.6, 12)
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    places = [transforms.Similarity(r, turn, c) for r, c in zip(radii, centres, strict=True)]
    positions = rng.uniform(-4, 4, (500, 3))
    found = scene_field.closest([SPHERE] * 12, [_to_unit_sphere] * 12, places, positions)
    away = positions[:, None] - centres
    length = np.linalg.norm(away, axis=-1)
    each = np.abs(length - radii)
    np.testing.assert_allclose(found.distances, each.min(axis=1))
    near = each.argmin(axis=1)
    rows = np.arange(500)
    way = -np.sign(length - radii)[..., None] * away / length[..., None]
    np.testing.assert_allclose(found.directions, way[rows, near])
    assert 500 <= found.queries < 0.4 * 12 * 500


def test_scenes_of_one_field_ask_it_once_a_point():
    found = scene_field.closest([SPHERE], [_to_unit_sphere], [transforms.Similarity(2.0)], np.eye(3))
    np.testing.assert_allclose(found.distances, 1.0)
    np.testing.assert_allclose(found.directions, np.eye(3))
    assert found.queries == 3


@pytest.mark.parametrize("count", [0, 1])
def test_any_number_of_points(count):
    found = scene_field.closest([SPHERE], [_to_unit_sphere], [transforms.Similarity()], 2 * np.ones((count, 3)))
    assert found.distances.shape == (count,) and found.directions.shape == (count, 3)

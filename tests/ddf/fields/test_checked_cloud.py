"""Clouds of the surest hits: on exact fields they lie on the surface, and distances are those to it."""

import numpy as np
import pytest
from _closed_form import ClosedForm

from ddf.core import checks
from ddf.fields import checked_cloud, scene_field
from ddf.geometry import primitives

SPHERE = ClosedForm(primitives.Sphere(radius=0.8))


def test_distances_to_an_exact_sphere():
    counted = scene_field.Counted(SPHERE)
    cloud = checked_cloud.draw(counted, 5000)
    assert 1000 < len(cloud.hits) <= 5000 and counted.queries < 10 * 5000
    np.testing.assert_allclose(np.linalg.norm(cloud.hits, axis=1), 0.8, atol=0.012)  # planes cut under the sphere
    positions = np.random.default_rng(1).uniform(-1, 1, (500, 3))
    length = np.linalg.norm(positions, axis=1)
    distances, directions = cloud.distances(positions)
    np.testing.assert_allclose(distances, np.abs(length - 0.8), atol=0.04)
    assert np.abs(distances - np.abs(length - 0.8)).mean() < 5e-3
    far = np.abs(length - 0.8) > 0.2
    cosine = (directions * -np.sign(length - 0.8)[:, None] * positions / length[:, None]).sum(1)
    assert np.degrees(np.arccos(np.median(cosine[far]))) < 5
    assert cloud.distances(cloud.hits[:2])[0].max() < 1e-12
    assert cloud.distances(np.zeros((0, 3)))[1].shape == (0, 3)


def test_hits_that_the_field_denies_from_elsewhere_do_not_count():
    class Wavering(ClosedForm):
        def evaluate(self, positions, directions, outputs):
            found = super().evaluate(positions, directions, outputs)
            return found | {"depth": np.where(positions[:, 0] > 0, found["depth"], 1.3 * found["depth"])}

    hits = checked_cloud.draw(Wavering(primitives.Sphere(radius=0.8)), 8000).hits
    wrong = np.abs(np.linalg.norm(hits, axis=1) - 0.8) > 0.05  # half of all are, by 0.3 of their depth
    assert wrong.mean() < 0.02 and (hits[:, 0] > 0.1).mean() > 0.3


def test_a_part_that_the_field_sees_badly_keeps_hits():
    class Unsure(ClosedForm):
        """Sees x < 0 as through a mist: depths that depend on the start, by a tenth of it."""

        def evaluate(self, positions, directions, outputs):
            found = super().evaluate(positions, directions, outputs)
            mist = 0.05 * np.sin(40 * positions).sum(axis=1) * (positions[:, 0] < 0.1)
            return found | {"depth": found["depth"] + mist}

    cloud = checked_cloud.draw(Unsure(primitives.Sphere(radius=0.8)), 8000)
    left = np.random.default_rng(0).standard_normal((500, 3)) * [1, 0.3, 0.3]
    left[:, 0] = -np.abs(left[:, 0])
    left *= 0.8 / np.linalg.norm(left, axis=1, keepdims=True)
    distances, _ = cloud.distances(left)
    assert distances.max() < 0.12  # no hole
    off = np.abs(np.linalg.norm(cloud.hits[cloud.hits[:, 0] < -0.2], axis=1) - 0.8)
    assert np.median(off) < 0.02  # of a mist whose usual depth is 0.05


def test_the_surest_of_near_hits_stay_and_strays_go():
    rng = np.random.default_rng(0)
    plane = np.concatenate([rng.uniform(-1, 1, (4000, 2)), np.zeros((4000, 1))], axis=1)
    doubts = rng.uniform(0, 0.1, 4000) + np.where(plane[:, 0] > 0, 0.05, 0.0)
    strays = rng.uniform(2, 4, (20, 3))
    hits = np.concatenate([plane, strays])
    found = checked_cloud.surest(hits, np.concatenate([doubts, np.zeros(20)]), 1.0)
    assert 0.2 < len(found) / 4000 < 0.4
    assert 0.45 < (found[:, 0] > 0).mean() < 0.55  # the half in doubt keeps its share
    assert (found[:, 2] == 0).all()
    kept = doubts[np.isin(plane[:, 0], found[:, 0])]
    assert np.median(kept) < 0.6 * np.median(doubts)
    assert len(checked_cloud.surest(plane, np.full(4000, 2.0), 1.0)) == 0
    np.testing.assert_array_equal(checked_cloud.surest(plane[:9], doubts[:9], 1.0), plane[:9])


def test_a_field_without_a_surface_is_told(monkeypatch):
    monkeypatch.setattr(checked_cloud, "_MOST_BATCHES", 3)
    nothing = ClosedForm(primitives.Sphere((9.0, 0.0, 0.0)))
    with pytest.raises(checks.InputError, match="sees no surface that it confirms"):
        checked_cloud.draw(nothing, 10)


def test_discs_take_noise_off_and_leave_the_shape():
    rng = np.random.default_rng(0)
    sphere = rng.standard_normal((6000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    noisy = sphere * (1 + 0.01 * rng.standard_normal((6000, 1)))
    found = checked_cloud.flat_discs(noisy, 16)
    off = np.abs(np.linalg.norm(found.centres, axis=1) - 1)
    assert off.mean() < 0.6 * np.abs(np.linalg.norm(noisy, axis=1) - 1).mean()
    assert np.median(np.abs((found.normals * sphere).sum(1))) > 0.95
    assert np.median(np.pi * found.radii**2) * 6000 == pytest.approx(8 * np.pi, rel=0.4)


def test_discs_of_a_plane_are_the_plane():
    rng = np.random.default_rng(1)
    plane = np.concatenate([rng.uniform(-1, 1, (500, 2)), np.zeros((500, 1))], axis=1)
    found = checked_cloud.flat_discs(plane, 16)
    np.testing.assert_allclose(found.centres, plane, atol=1e-12)
    np.testing.assert_allclose(np.abs(found.normals), np.tile([0.0, 0.0, 1.0], (500, 1)), atol=1e-9)
    above = plane + np.array([0.3, 0.0, 2.0]) * found.radii[:, None]
    np.testing.assert_allclose(found.foot(np.arange(500), above), above * [1, 1, 0], atol=1e-12)
    beyond = plane + np.array([3.0, 0.0, 2.0]) * found.radii[:, None]
    reached = found.foot(np.arange(500), beyond) - plane
    np.testing.assert_allclose(reached, found.radii[:, None] * [1.0, 0.0, 0.0], atol=1e-12)
    few = checked_cloud.flat_discs(plane[:16], 16)
    np.testing.assert_allclose(few.foot(np.arange(16), above[:16]), plane[:16])

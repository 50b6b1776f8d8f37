"""Composites and their parts: normals are the nearest part's own, and culling changes nothing but the queries."""

import copy
import dataclasses

import _closed_form
import numpy as np
import pytest

from ddf.core import shipped_models
from ddf.fields import framed_field, scene_field, shape_field
from ddf.geometry import primitives, rays, transforms

TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # a quarter about y
PLACES = (
    transforms.Similarity(0.5, TURN, np.array([0.6, 0.1, 0.0])),
    transforms.Similarity(0.3, np.eye(3), -np.ones(3) / 2),
)
ASKED = ("visibility", "depth", "normals")


def _scene(*fields):
    return scene_field.SceneField(fields, PLACES, np.full(3, -1.5), np.full(3, 1.5))


def _closed():
    return _scene(_closed_form.ClosedForm(_closed_form.Torus()), _closed_form.ClosedForm(primitives.Sphere(radius=0.8)))


def _networks():
    field = shape_field.load(shipped_models.place("rabbit"))
    double = dataclasses.replace(field, field=copy.deepcopy(field.field).double())  # products round alike in float64
    return _scene(double, double)


def _points(count):
    random = np.random.default_rng(0)
    positions, directions = random.uniform(-1.4, 1.4, (count, 3)), random.standard_normal((count, 3))
    return rays.OrientedPoints(positions, directions / np.linalg.norm(directions, axis=1, keepdims=True))


@pytest.mark.parametrize(("make", "count"), [(_closed, 4000), (_networks, 1000)])
def test_composite_normals_are_the_nearest_parts_own_and_culling_changes_nothing(make, count):
    scene, points = make(), _points(count)
    found, _ = framed_field.query(scene, points, ASKED)
    nearest, normals = np.full(count, np.inf), np.zeros((count, 3))
    for field, place in zip(scene.fields, scene.scene_from_mesh, strict=True):
        back = place.inverse()
        own = rays.OrientedPoints(back.apply(points.positions), back.apply_directions(points.directions))
        alone, _ = framed_field.query(field, own, ASKED)
        depth = np.where(alone["visibility"] >= framed_field.SEEN, place.scale_depth(alone["depth"]), np.inf)
        nearer = depth < nearest
        nearest[nearer], normals[nearer] = depth[nearer], place.apply_directions(alone["normals"][nearer])
    seen = np.isfinite(found["depth"])
    assert seen.sum() > 20
    np.testing.assert_allclose(found["depth"], nearest, atol=1e-9)
    np.testing.assert_allclose(found["normals"][seen], normals[seen], atol=1e-7)
    whole, _ = framed_field.query(dataclasses.replace(scene, cull=False), points, ("visibility", "depth"))
    for name in whole:
        np.testing.assert_allclose(found[name], whole[name], atol=1e-12)


def test_culling_asks_fewer_queries():
    asked, scene = [], _closed()
    for cull in (True, False):
        counted = tuple(scene_field.Counted(field) for field in scene.fields)
        framed_field.query(dataclasses.replace(scene, fields=counted, cull=cull), _points(4000), ("depth",))
        asked.append(sum(each.queries for each in counted))
    assert 0 < asked[0] < asked[1] / 2

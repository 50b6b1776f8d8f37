"""What the page says of composites and their parts: exact ones agree, and a wrong part is told by its angle."""

import dataclasses

import _closed_form
import numpy as np
import pytest

from ddf.core import shipped_models
from ddf.fields import framed_field, shape_field
from ddf.fields.scenes import scene_field
from ddf.geometry import primitives, rays, transforms
from ddf_lab.figures import room_figure

TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # a quarter about y
TORUS = _closed_form.ClosedForm(_closed_form.Torus())
BALL = _closed_form.ClosedForm(primitives.Sphere(radius=0.8))
PLACES = (
    transforms.Similarity(0.5, TURN, np.array([0.6, 0.1, 0.0])),
    transforms.Similarity(0.3, np.eye(3), -np.ones(3) / 2),
)
SCENE = scene_field.SceneField((TORUS, BALL), PLACES, np.full(3, -1.5), np.full(3, 1.5))


def _points(count=4000):
    random = np.random.default_rng(0)
    positions, directions = random.uniform(-1.4, 1.4, (count, 3)), random.standard_normal((count, 3))
    return rays.OrientedPoints(positions, directions / np.linalg.norm(directions, axis=1, keepdims=True))


def test_composite_normals_are_the_parts_own_and_culling_changes_nothing():
    seen, angle, visibility, depth = room_figure.agreement(SCENE, _points())
    assert seen > 200
    assert angle < 1e-6 and visibility == 0 and depth < 1e-12


class _Crooked(scene_field.SceneField):
    """Turns the normals of the composite by ten degrees about y, and sees further when nothing is culled."""

    def evaluate(self, positions, directions, outputs):
        found = super().evaluate(positions, directions, outputs)
        if "normals" in found:
            c, s = np.cos(np.radians(10)), np.sin(np.radians(10))
            found["normals"] = found["normals"] @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
        return found | {"depth": found["depth"] + (0.0 if self.cull else 0.25)}


def test_wrong_normals_and_wrong_culling_are_told():
    scene = _Crooked(**{field.name: getattr(SCENE, field.name) for field in dataclasses.fields(SCENE)})
    _, angle, visibility, depth = room_figure.agreement(scene, _points())
    assert 9 < angle <= 10 + 1e-6  # a normal along y does not turn
    assert visibility == 0 and depth == pytest.approx(0.25)


def test_culling_asks_fewer_queries():
    asked = []
    for cull in (True, False):
        counted = tuple(scene_field.Counted(field) for field in SCENE.fields)
        framed_field.query(dataclasses.replace(SCENE, fields=counted, cull=cull), _points(), ("depth",))
        asked.append(sum(each.queries for each in counted))
    assert 0 < asked[0] < asked[1] / 2


def test_networks_in_float64_are_culled_without_a_difference():
    field = shape_field.load(shipped_models.place("rabbit"))
    scene = scene_field.SceneField((field, field), PLACES, np.full(3, -1.5), np.full(3, 1.5))
    double = room_figure._double(scene)
    seen, angle, visibility, depth = room_figure.agreement(double, _points(1000))
    assert seen > 20
    assert angle < 1e-6 and visibility < 1e-12 and depth < 1e-12
    (kind,) = {each.dtype for each in field.field.parameters()}
    assert str(kind) == "torch.float32"  # the scene's own networks are left as they are

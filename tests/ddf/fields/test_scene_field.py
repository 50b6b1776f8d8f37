"""Scenes of several fields: the same surfaces cast as one, hard and soft; unsigned distances; cameras and flights."""

import copy
import dataclasses
import math
import types
from typing import Any

import _closed_form
import numpy as np
import pytest
import torch
from _shapes import random_rays

from ddf.core import checks, shipped_models
from ddf.fields import framed_field, scene_field, shape_field
from ddf.geometry import primitives, rays, transforms

OUTPUTS = ("visibility", "depth", "normals", "mean_curvature", "gaussian_curvature")
SPHERE = _closed_form.ClosedForm(primitives.Sphere(radius=0.8))
BOX = _closed_form.ClosedForm(primitives.Box((-0.9, -0.4, -0.7), (0.8, 0.5, 0.6)))
TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # a quarter about y
PLACES = (
    transforms.Similarity(0.5, TURN, np.array([0.7, 0.1, 0.0])),
    transforms.Similarity(0.25, np.eye(3), -np.ones(3) / 2),
)
UNION = primitives.Union((primitives.Sphere((0.7, 0.1, 0.0), 0.4), primitives.Sphere((-0.5, -0.5, -0.5), 0.2)))


def _scene(fields=(SPHERE, SPHERE), blend=None):
    return scene_field.SceneField(fields, PLACES, np.full(3, -1.5), np.full(3, 1.5), blend)


def _points(count=3000, seed=1):
    points = random_rays(count, seed, spread=1.2)
    return rays.OrientedPoints(points.positions.numpy(), points.directions.numpy())


def test_every_output_of_a_scene_is_that_of_the_surfaces_cast_as_one():
    points = _points()
    found, _ = framed_field.query(_scene(), points, OUTPUTS)
    tensors = rays.OrientedPoints(torch.from_numpy(points.positions), torch.from_numpy(points.directions))
    hits, curvatures = primitives.cast(UNION, tensors), primitives.curvatures(UNION, tensors)
    assert 100 < hits.visible.sum() < 2000
    for name, truth in (
        ("visibility", hits.visible.double()),
        ("depth", hits.depth),
        ("normals", hits.normals),
        ("mean_curvature", curvatures.sum(-1)),
        ("gaussian_curvature", curvatures.prod(-1)),
    ):
        np.testing.assert_allclose(found[name], truth.numpy(), atol=1e-9, err_msg=name)


@pytest.mark.parametrize("fields", [(SPHERE, SPHERE), (SPHERE, BOX)])
def test_soft_goes_to_hard_with_the_temperature(fields):
    """Along rays from a point within the first object to one within the second, from before the first."""
    rng = np.random.default_rng(2)
    inside = [place.apply(0.5 * rng.uniform(-1, 1, (300, 3))) for place in PLACES]
    directions = (inside[1] - inside[0]) / np.linalg.norm(inside[1] - inside[0], axis=1, keepdims=True)
    points = rays.OrientedPoints(inside[0] - directions, directions)
    hard, _ = framed_field.query(_scene(fields), points, OUTPUTS)
    both = np.isfinite(hard["depth"])
    gaps = []
    for temperature in (1.0, 0.1, 1e-6):
        soft, _ = framed_field.query(_scene(fields, scene_field.Blend(temperature)), points, OUTPUTS)
        np.testing.assert_allclose(np.linalg.norm(soft["normals"][both], axis=-1), 1.0)
        gaps.append(np.abs(soft["depth"][both] - hard["depth"][both]).mean())
    assert both.sum() > 100 and gaps[0] > 2 * gaps[1] > 0
    for name in OUTPUTS:
        np.testing.assert_allclose(soft[name][both], hard[name][both], atol=1e-9, err_msg=name)


def test_soft_normals_are_the_weighted_mean_of_both_fields():
    """Two spheres seen one behind the other, on axis, have one normal; off axis the mean of two."""
    scene = dataclasses.replace(
        _scene(blend=scene_field.Blend(0.5)),
        scene_from_mesh=(transforms.Similarity(0.5), transforms.Similarity(0.5, np.eye(3), np.array([0.0, 0.0, -1.0]))),
    )
    start, along = np.array([[0.1, 0.0, 1.4]]), np.array([[0.0, 0.0, -1.0]])
    found = scene.evaluate(start, along, ("depth", "normals"))
    parts = [primitives.Sphere((0.0, 0.0, z), 0.4) for z in (0.0, -1.0)]
    tensors = rays.OrientedPoints(torch.from_numpy(start), torch.from_numpy(along))
    hits = [primitives.cast(part, tensors) for part in parts]
    depths, normals = (np.concatenate([getattr(hit, name).numpy() for hit in hits]) for name in ("depth", "normals"))
    weights = np.exp(1 / (0.5 * (0.05 + depths)))
    weights /= weights.sum()
    mean = weights @ normals
    np.testing.assert_allclose(found["depth"], weights @ depths)
    np.testing.assert_allclose(found["normals"][0], mean / np.linalg.norm(mean))


def test_only_the_field_that_is_seen_is_asked_for_normals():
    counted = tuple(scene_field.Counted(SPHERE) for _ in PLACES)
    points = _points()
    depth, _ = framed_field.query(_scene(counted), points, ("depth",))
    for_depth = sum(field.queries for field in counted)
    assert 0 < for_depth < len(points.positions)
    framed_field.query(_scene(counted), points, ("depth", "normals"))
    assert sum(field.queries for field in counted) == 2 * for_depth + np.isfinite(depth["depth"]).sum()


def _networks():
    field = shape_field.load(shipped_models.place("rabbit-network"))
    double = dataclasses.replace(field, field=copy.deepcopy(field.field).double())  # products round alike in float64
    return _scene((double, double))


@pytest.mark.parametrize(("make", "count"), [(lambda: _scene((BOX, SPHERE)), 4000), (_networks, 1000)])
def test_composite_normals_are_the_nearest_parts_own(make, count):
    scene, points, asked = make(), _points(count), ("visibility", "depth", "normals")
    found, _ = framed_field.query(scene, points, asked)
    nearest, normals = np.full(count, np.inf), np.zeros((count, 3))
    for field, place in zip(scene.fields, scene.scene_from_mesh, strict=True):
        back = place.inverse()
        own = rays.OrientedPoints(back.apply(points.positions), back.apply_directions(points.directions))
        alone, _ = framed_field.query(field, own, asked)
        depth = np.where(alone["visibility"] >= framed_field.SEEN, place.scale_depth(alone["depth"]), np.inf)
        nearer = depth < nearest
        nearest[nearer], normals[nearer] = depth[nearer], place.apply_directions(alone["normals"][nearer])
    seen = np.isfinite(found["depth"])
    assert seen.sum() > 20
    np.testing.assert_allclose(found["depth"], nearest, atol=1e-9)
    np.testing.assert_allclose(found["normals"][seen], normals[seen], atol=1e-7)


def _to_unit_sphere(positions):
    length = np.linalg.norm(positions, axis=-1)
    return np.abs(length - 1), np.sign(1 - length)[:, None] * positions / length[:, None]


def test_distances_and_directions_are_those_of_the_nearest_sphere():
    rng = np.random.default_rng(0)
    centres, radii = rng.uniform(-3, 3, (12, 3)), rng.uniform(0.2, 0.6, 12)
    places = [transforms.Similarity(r, TURN, c) for r, c in zip(radii, centres, strict=True)]
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


@pytest.mark.parametrize("count", [0, 3])
def test_scenes_of_one_field_ask_it_once_a_point(count):
    found = scene_field.closest([SPHERE], [_to_unit_sphere], [transforms.Similarity(2.0)], np.eye(3)[:count])
    np.testing.assert_allclose(found.distances, np.ones(count))
    np.testing.assert_allclose(found.directions, np.eye(3)[:count])
    assert found.queries == count


def _constant(**says) -> Any:
    """A field that says the same of every ray."""
    box = {"lower": -np.ones(3), "upper": np.ones(3), "field_from_mesh": transforms.Similarity()}
    ask = lambda positions, _, outputs: {name: np.full(len(positions), says[name]) for name in outputs}  # noqa: E731
    return types.SimpleNamespace(**box, outputs=tuple(says), evaluate=ask)


def test_what_stands_behind_a_surface_is_not_asked():
    rng = np.random.default_rng(4)
    sizes, centres = rng.uniform(0.1, 0.4, 60), rng.normal(size=(60, 3))
    places = tuple(transforms.Similarity(size, TURN, centre) for size, centre in zip(sizes, centres, strict=True))
    starts = rng.normal(size=(2000, 3))
    starts *= 1e3 / np.linalg.norm(starts, axis=1, keepdims=True)
    ways = rng.normal(size=starts.shape) - starts
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    counted = tuple(scene_field.Counted(SPHERE) for _ in places)
    box = np.full(3, -9.0), np.full(3, 9.0)
    found = scene_field.SceneField(counted, places, *box).evaluate(starts, ways, OUTPUTS)
    asked, seen = sum(field.queries for field in counted), int(np.isfinite(found["depth"]).sum())
    alone = [scene_field.SceneField((one,), (place,), *box) for one, place in zip(counted, places, strict=True)]
    each = np.stack([scene.evaluate(starts, ways, ("depth",))["depth"] for scene in alone])
    np.testing.assert_allclose(found["depth"], each.min(axis=0), rtol=1e-12)
    every = sum(field.queries for field in counted) - asked
    assert seen > 500 and asked - seen < 0.8 * every


def test_a_field_in_many_places_is_asked_of_all_at_once_and_far_from_0_too():
    calls, rng = [], np.random.default_rng(5)
    ask = lambda *asked: (calls.append(len(asked[0])), SPHERE.evaluate(*asked))[1]  # noqa: E731
    parts = {name: getattr(SPHERE, name) for name in ("lower", "upper", "field_from_mesh", "outputs")}
    one: Any = types.SimpleNamespace(**parts, evaluate=ask)
    centres, far = rng.uniform(-9, 9, (200, 3)), np.array([1e5, -1e5, 1e5])
    points = random_rays(500, 6, spread=5.0)
    starts, ways = points.positions.numpy().astype(np.float64), points.directions.numpy().astype(np.float64)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    depths = []
    for offset, fields in (np.zeros(3), (one,) * 200), (far, (one,) * 200), (far, [copy.copy(one) for _ in centres]):
        calls.clear()
        places = tuple(transforms.Similarity(0.4, TURN, offset + centre) for centre in centres)
        scene = scene_field.SceneField(tuple(fields), places, offset - 10, offset + 10)
        depths.append((scene.evaluate(offset + starts, ways, ("depth",))["depth"], len(calls)))
    (near, few), (moved, as_few), (alone, many) = depths
    assert few == as_few < 20 < many and 40 < np.isfinite(near).sum() < 450
    np.testing.assert_array_equal(alone, moved)
    np.testing.assert_allclose(moved, near, atol=1e-6)


ROWS = [  # visibilities and depths of the fields; visibility, depth and depth of the hard choice
    pytest.param([1.0, 1.0], [0.0, 0.0], 1.0, 0.0, 0.0, id="both at depth 0"),
    pytest.param([0.0] * 3, [0.25, 0.5, 0.75], 0.0, 0.5, math.inf, id="nothing visible"),
    pytest.param([0.75] * 2, [0.5] * 2, 0.9375, 0.5, 0.5, id="the same field twice"),
    pytest.param([0.0] * 2, [math.inf] * 2, 0.0, math.inf, math.inf, id="every box missed"),
    pytest.param([1.0, 1.0], [0.5, 1e4], 1.0, 0.5, 0.5, id="a field far behind another"),
]


@pytest.mark.parametrize(("visibilities", "depths", "visibility", "depth", "nearest"), ROWS)
def test_composites_of_constant_fields(visibilities, depths, visibility, depth, nearest):
    given = np.array(visibilities)[:, None], np.array(depths)[:, None]
    soft, _ = scene_field.compose(*given, scene_field.Blend(1e-4))
    assert (soft["visibility"][0], soft["depth"][0]) == (pytest.approx(visibility), pytest.approx(depth))
    fields = tuple(_constant(visibility=v, depth=d) for v, d in zip(visibilities, depths, strict=True))
    places = (transforms.Similarity(),) * len(fields)
    hard = scene_field.SceneField(fields, places, np.full(3, -1.0), np.ones(3))
    hard = hard.evaluate(np.zeros((1, 3)), np.eye(3)[:1], ("visibility", "depth"))
    assert (hard["visibility"][0], hard["depth"][0]) == (max(visibilities), nearest)


@pytest.mark.parametrize(("constant", "depth"), [(1e-30, 0.25), (1e-300, 0.25), (1e30, 0.375)])
def test_tiny_and_huge_constants_give_the_nearer_one_and_the_mean(constant, depth):
    found, _ = scene_field.compose(np.ones((2, 1)), np.array([[0.25], [0.5]]), scene_field.Blend(constant, constant))
    assert (found["visibility"][0], found["depth"][0]) == (1.0, pytest.approx(depth))


def test_soft_depth_is_the_paper_s_sum_over_the_fields_that_take_part():
    random = np.random.default_rng(0)
    visibilities, depths = random.uniform(size=(3, 200)), random.uniform(size=(3, 200))
    depths[random.uniform(size=depths.shape) < 0.3] = np.inf
    visibilities[np.isinf(depths)] = 0
    found, weights = scene_field.compose(visibilities, depths, scene_field.Blend(0.3, 0.2))
    for i in range(200):
        part = np.isfinite(depths[:, i])
        powers = np.exp(visibilities[part, i] / (0.3 * (0.2 + depths[part, i])))
        expected = powers @ depths[part, i] / powers.sum() if part.any() else np.inf
        assert found["depth"][i] == pytest.approx(expected)
        assert weights[:, i].sum() == pytest.approx(float(part.any()))


FIELD = _closed_form.ClosedForm(primitives.Sphere(), np.array([-1.0, -0.4, -0.7]), np.array([1.0, 0.6, 0.7]))


@pytest.mark.parametrize("up", ["y", "z"])
@pytest.mark.parametrize("camera", [(35.0, 25.0, 0.9), (-140.0, -60.0, 2.0)])
def test_one_camera_has_the_rays_of_a_render(camera, up):
    starts, directions = framed_field.camera_rays(FIELD, camera, 9, up)
    azimuth, elevation, radius = camera
    found = scene_field.one(FIELD, azimuth, elevation, radius, up).rays(9, up)
    np.testing.assert_allclose(found[0], starts, atol=1e-12)
    np.testing.assert_allclose(found[1], directions, atol=1e-12)


def test_flights_pass_every_waypoint_and_go_straight_between():
    stops = [scene_field.LookAt(np.array([i, i**2, 0.0]), np.array([i, i**2, 1.0])) for i in range(3)]
    looks = scene_field.fly(stops, 5)
    passed = [[0, 0, 0], [0.5, 0.5, 0], [1, 1, 0], [1.5, 2.5, 0], [2, 4, 0]]
    np.testing.assert_allclose([look.position for look in looks], passed)
    np.testing.assert_allclose([look.target - look.position for look in looks], [[0, 0, 1]] * 5)


def test_straight_in_ends_in_the_middle_of_the_box():
    start = scene_field.one(FIELD, 30.0, 10.0, 2.0, "y")
    first, last = scene_field.straight_in(FIELD, start)
    np.testing.assert_allclose(first.position, start.position)
    np.testing.assert_allclose(last.position, [0.0, 0.1, 0.0], atol=1e-12)
    way = last.position - first.position
    np.testing.assert_allclose(np.cross(way, last.target - last.position), 0.0, atol=1e-12)


def test_looking_straight_down_has_an_orientation():
    _, directions = scene_field.LookAt(np.array([0.0, 3.0, 0.0]), np.zeros(3)).rays(3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    np.testing.assert_allclose(directions[4], [0.0, -1.0, 0.0], atol=1e-12)


def test_cameras_that_cannot_look_are_refused():
    with pytest.raises(checks.InputError, match="must look away from where it stands"):
        scene_field.LookAt(np.ones(3), np.ones(3))
    with pytest.raises(checks.InputError, match="finite"):
        scene_field.LookAt(np.ones(3), np.full(3, np.nan))
    with pytest.raises(checks.InputError, match="two waypoints or more; got 1"):
        scene_field.fly([scene_field.LookAt(np.ones(3), np.zeros(3))], 4)

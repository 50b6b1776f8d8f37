"""Shaded pictures of an exact ball: where it is, what its lamp sees, what its shadow covers, which rays are asked."""

import dataclasses

import numpy as np
import pytest
from _closed_form import ClosedForm

from ddf.core import checks
from ddf.fields import framed_field, scene_field
from ddf.geometry import cameras, primitives, transforms
from ddf.pictures import shaded

RADIUS = 0.6
CAMERA = (30.0, 25.0)
SIZE = 48
MIDDLE = np.array([1.0, 2.0, 3.0])
FRAME = transforms.Similarity(0.5, np.diag([-1.0, 1.0, -1.0]), MIDDLE)
BALL = primitives.Sphere((1.0, 2.0, 3.0), RADIUS), MIDDLE - 1, MIDDLE + 1  # at the centre of its box


@pytest.fixture(scope="module")
def standing():
    """In a frame turned and scaled against that of its mesh."""
    return shaded.stand(ClosedForm(*BALL, FRAME))


@pytest.fixture(scope="module")
def drawn(standing):
    camera = (*CAMERA, framed_field.framing_radius(standing.field, *CAMERA))
    return camera, shaded.render(standing, camera, SIZE)


def test_the_ground_is_at_the_lowest_point(standing):
    assert standing.floor == pytest.approx(-RADIUS / 0.5, abs=0.01)


def test_the_ground_is_under_the_box_where_rays_from_below_meet_nothing():
    class Nothing(ClosedForm):
        def evaluate(self, positions, directions, outputs):
            found = super().evaluate(positions, directions, outputs)
            return found | {"visibility": np.zeros(len(positions))}

    standing = shaded.stand(Nothing(*BALL, FRAME))
    assert standing.floor == pytest.approx(-1 / 0.5, rel=0.01)
    assert shaded.window(standing, [(0.0, 0.0, 1.0)]) == shaded.WHOLE
    assert (shaded.render(standing, (0.0, 0.0, 1.0), 8).picture == 255).all()


def test_a_small_low_object_of_a_scene_stands_on_the_ground_and_is_in_the_window():
    field = ClosedForm(primitives.Sphere((0.0, 0.0, 0.0), RADIUS), -np.ones(3), np.ones(3))
    large, small = (1.0, [0.0, 9, 0]), (0.1, [30.0, 0, 0])
    places = [transforms.Similarity(scale, np.eye(3), np.array(at)) for scale, at in (large, small)]
    scene = scene_field.SceneField((field, field), tuple(places), np.array([-1, -0.1, -1]), np.array([30.1, 10, 1]))
    standing = shaded.stand(scene)
    assert standing.axes()[0][1] + standing.floor == pytest.approx(-0.1 * RADIUS, abs=0.02)
    camera = (70.0, 25.0, framed_field.framing_radius(scene, 70.0, 25.0))
    left, top, side = shaded.window(standing, [camera])
    corners = shaded.project(standing, camera, np.concatenate([place.apply(field.lower[None] * 0) for place in places]))
    assert (corners > (left, top)).all() and (corners < np.add((left, top), side)).all() and side < 1


def test_what_sees_the_ball_is_its_disc(drawn):
    camera, found = drawn
    distance = camera[2] * np.sqrt(12) / transforms.BENCHMARK_FROM_V1 / RADIUS  # of the camera, in radii
    radius_px = cameras.FOCAL_PX / cameras.IMAGE_SIZE * SIZE / np.sqrt(distance**2 - 1)
    assert found.seen.sum() == pytest.approx(np.pi * radius_px**2, rel=0.01)
    rows, columns = np.nonzero(found.seen > 0.5)
    assert (rows.mean(), columns.mean()) == pytest.approx((SIZE / 2 - 0.5,) * 2, abs=0.1)


def test_the_side_of_the_lamp_is_bright_and_the_shadow_falls_on_the_other(drawn):
    _, found = drawn
    grey, on_it = found.picture.mean(-1), found.seen == 1
    left = np.arange(SIZE)[None, :] < SIZE / 2
    upper = np.arange(SIZE)[:, None] < SIZE / 2
    assert grey[on_it & left & upper].mean() > 1.4 * grey[on_it & ~left & ~upper].mean()
    ground = found.seen == 0
    assert (grey[ground & left & upper] == 255).all()
    assert (grey[ground & ~left] < 230).sum() > 20


def test_few_rays_are_asked_and_sides_are_smooth(standing, drawn):
    counted, (camera, found) = scene_field.Counted(standing.field), drawn
    shaded.render(dataclasses.replace(standing, field=counted), camera, SIZE)
    assert 0 < counted.queries < 0.25 * 2 * shaded.MOST_SAMPLES * SIZE**2
    assert ((found.seen > 0) & (found.seen < 1)).sum() > SIZE  # its outline


def test_a_window_holds_what_all_cameras_see(standing, drawn):
    camera, _ = drawn
    shown = shaded.window(standing, [camera, (camera[0] + 90, *camera[1:])])
    close = shaded.render(standing, camera, SIZE, shown)
    assert not close.seen[[0, -1]].any() and not close.seen[:, [0, -1]].any()
    assert close.seen.sum() / SIZE**2 > 0.5


@pytest.mark.parametrize(("camera", "size"), [((0.0, 0.0, 1.0), 0), ((np.nan, 0.0, 1.0), 8)])
def test_no_picture_and_no_camera_are_refused(standing, camera, size):
    with pytest.raises(checks.InputError, match="must be"):
        shaded.render(standing, camera, size)


def test_paint_is_asked_for_on_the_surface_and_lit(standing, drawn):
    camera, clay = drawn
    back = standing.field.field_from_mesh.inverse()
    centre = back.apply(MIDDLE[None])[0]
    asked = []

    def red(points):
        asked.append(points)
        return np.tile(np.array([255, 0, 0], np.uint8), (len(points), 1))

    painted = shaded.render(standing, camera, SIZE, colours=red)
    distance = np.linalg.norm(np.concatenate(asked) - centre, axis=-1) * standing.field.field_from_mesh.scale
    np.testing.assert_allclose(distance, RADIUS, atol=1e-9)
    np.testing.assert_array_equal(painted.seen, clay.seen)
    ball, ground = painted.seen == 1, painted.seen == 0
    assert (painted.picture[ball][:, 0] > painted.picture[ball][:, 1]).all()
    np.testing.assert_array_equal(painted.picture[ground], clay.picture[ground])


def test_occlusion_is_the_share_of_the_sky_that_is_hidden_by_the_cosine():
    """Where all ways with x > 0 end near, of mesh and field alike, (1 - n_x)/2 of the sky of a normal n is left."""

    class Half(ClosedForm):
        def evaluate(self, positions, directions, outputs):
            return {"depth": np.full(len(positions), 0.01), "visibility": (directions[:, 0] > 0).astype(float)}

    standing = shaded.Standing(Half(*BALL, transforms.Similarity(0.5, np.eye(3), MIDDLE)), "y", 0.0)
    normals = np.random.default_rng(0).standard_normal((50, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = shaded._Light(standing, (0.0, 0.0, 1.0), shaded.WHOLE, 8, None, 400).open(np.zeros((50, 3)), normals)
    np.testing.assert_allclose(found, (1 - normals[:, 0]) / 2, atol=0.02)


def test_a_ball_hides_no_sky_from_itself(standing, drawn):
    assert np.array_equal(shaded.render(standing, drawn[0], SIZE, sky=16).picture, drawn[1].picture)

"""The mesh that a picture shows: thin legs of an unsure field stay, what the picture denies and small parts go."""

import numpy as np
import pytest
import trimesh
from _shapes import icosphere

from ddf.core import checks
from ddf.data import mesh_topology
from ddf.fit import patch_fitting
from ddf.geometry import cameras, carved_surface, mesh_io, raycast, transforms
from ddf.reconstruction import solid

CAMERA = (0.6, 0.35, 0.8)
LEGS = [(x, -0.2, z) for x in (-0.14, 0.14) for z in (-0.14, 0.14)]


def _boxes(*placed):
    made = [trimesh.creation.box(size, trimesh.transformations.translation_matrix(place)) for place, size in placed]
    corners = np.concatenate([box.vertices for box in made])
    return mesh_io.Mesh(corners, np.concatenate([box.faces + 8 * i for i, box in enumerate(made)]))


CHAIR = (((0, 0, 0), (0.3, 0.04, 0.3)), *((place, (0.02, 0.38, 0.02)) for place in LEGS))


class _Unsure:
    """A field of a mesh of which each ray misses what it meets with some odds."""

    outputs = ("visibility", "depth")
    field_from_mesh = transforms.Similarity(2.0)
    lower, upper = np.full(3, -1.0), np.full(3, 1.0)

    def __init__(self, mesh, missed):
        self.scene, self.missed, self.random = raycast.Scene(mesh), missed, np.random.default_rng(0)

    def evaluate(self, positions, directions, outputs):
        depth = self.scene.first_hits(positions / 2, directions)[0]
        seen = np.isfinite(depth) & (self.random.random(len(depth)) >= self.missed)
        return {"visibility": seen.astype(float), "depth": np.where(seen, 2 * depth, 0.0)}


def _seen(mesh, size=137):
    (azimuth, elevation, radius), along = np.array(CAMERA), cameras.pixel_directions(size, np.zeros(()))
    centre, ways = cameras.pixel_rays(azimuth, elevation, radius, along.reshape(-1, 3))
    starts = np.broadcast_to(centre / transforms.BENCHMARK_FROM_V1, ways.shape).copy()
    return np.isfinite(raycast.Scene(mesh).first_hits(starts, ways)[0]).reshape(size, size)


def _made(field_of, shown, missed):
    mesh = _boxes(*shown)
    alpha = np.where(_seen(mesh, 274), 255, 0).astype(np.uint8)
    return mesh, solid.solid(_Unsure(field_of, missed), mesh.vertices, CAMERA, alpha)


@pytest.mark.parametrize("missed", [0.0, 0.2])
def test_legs_of_two_cells_stay_where_rays_miss_them(missed):
    shape, mesh = _made(_boxes(*CHAIR), CHAIR, missed)
    assert mesh_topology.is_watertight(mesh) and len(np.unique(mesh_topology.components(mesh))) == 1
    ours, theirs = _seen(mesh), _seen(shape)
    assert (ours & theirs).sum() > 0.92 * (ours | theirs).sum()
    for leg in LEGS:
        near = np.linalg.norm((mesh.vertices - leg)[:, [0, 2]], axis=1) < 0.03
        heights = np.histogram(mesh.vertices[near, 1], bins=20, range=(-0.38, -0.02))[0]
        assert (heights > 0).all()


def test_the_sides_of_a_thick_box_of_a_sure_field_are_right_within_a_cell():
    half = np.array([0.15, 0.1, 0.125])
    box = (((0, 0, 0), 2 * half),)
    _, mesh = _made(_boxes(*box), box, 0.0)
    for axis in range(3):
        inner = (np.abs(mesh.vertices / half)[:, np.arange(3) != axis] < 0.8).all(axis=1)
        for side in (-1, 1):
            away = side * mesh.vertices[inner, axis]
            assert np.median(away[away > 0]) == pytest.approx(half[axis], abs=0.75 * 1.1 * 0.3 / 80)


def test_a_node_that_meets_others_in_a_corner_alone_is_no_speck(monkeypatch):
    def mean(votes):
        found = np.full(votes.grid.shape, carved_surface.REACH, np.float32)
        found[20:40, 20:40, 20:40] = found[40, 40, 40] = -1.0
        return found.ravel()[votes.chosen]

    monkeypatch.setattr(carved_surface.Votes, "mean", mean)
    box = (((0, 0, 0), (0.3, 0.3, 0.3)),)
    _, mesh = _made(_boxes(*box), box, 0.0)
    assert len(trimesh.Trimesh(mesh.vertices, mesh.faces).split(only_watertight=False)) == 1  # joined by edges


def test_what_the_picture_denies_goes_and_so_do_specks_behind_the_object():
    beside, behind = ((0.0, 0.3, 0.0), (0.1, 0.1, 0.1)), ((-0.1, -0.1, -0.1), (0.03, 0.03, 0.03))
    _, mesh = _made(_boxes(*CHAIR, beside, behind), CHAIR, 0.0)
    assert mesh.vertices[:, 1].max() < 0.06
    assert len(np.unique(mesh_topology.components(mesh))) == 1


def test_a_small_part_that_the_picture_shows_stays():
    alone = ((0.0, 0.2, 0.0), (0.05, 0.05, 0.05))
    _, mesh = _made(_boxes(*CHAIR, alone), (*CHAIR, alone), 0.0)
    assert mesh.vertices[:, 1].max() == pytest.approx(0.225, abs=0.01)


@pytest.mark.parametrize(("opaque", "message"), [(255, "nothing is left"), (0, "is not where the model places")])
def test_nothing_is_said(opaque, message):
    far, alpha = _boxes(((2.0, 0, 0), (0.1, 0.1, 0.1))), np.full((64, 64), opaque, np.uint8)
    with pytest.raises(checks.InputError, match=message):
        solid.solid(_Unsure(far, 0.0), _boxes(*CHAIR).vertices, CAMERA, alpha)


def test_an_image_shows_what_its_camera_sees_of_a_ball():
    camera, ball = (0.5, 0.4, 0.8), icosphere(3, 0.3)
    paint = solid.Paint(patch_fitting.patches(ball), camera, np.full((64, 64, 4), 255, np.uint8))
    centre = cameras.extrinsics(*np.array(camera))[1] / transforms.BENCHMARK_FROM_V1
    facing = ball.vertices @ centre / (0.3 * np.linalg.norm(centre))  # cosine; the rim is at radius over distance
    shown, rim = paint._shown(ball.vertices)[1], 0.3 / np.linalg.norm(centre)
    assert shown[facing > rim + 0.05].all() and not shown[facing < rim - 0.2].any()


def test_places_beside_an_opaque_picture_are_as_far_as_they_are():
    places = np.array([[-8.0, -3, 142], [68, 68, 68]])  # row, column; the picture ends at 0 and 137; 3 pixels a cell
    assert solid._beside(np.ones((137, 137), bool), 3.0, places) == pytest.approx([8 / 3, 1, 5 / 3], abs=0.01)


def test_the_sheet_turns_from_the_camera_of_the_picture():
    bar = _boxes(((0, 0, 0), (0.6, 0.1, 0.1)))  # along X, where azimuth 0 is
    view = np.full((64, 64, 4), (200, 0, 0, 255), np.uint8)
    paint = solid.Paint(patch_fitting.patches(bar), (np.pi / 4, 0.0, 0.9), view)
    sheet = np.asarray(paint.sheet(64, (-45.0, 45.0))).astype(int)
    wide = [(sheet[32, 64 * n : 64 * n + 64, 0] - sheet[32, 64 * n : 64 * n + 64, 1] > 50).sum() for n in range(3)]
    assert wide[0] == 64 and 0 < 3 * wide[1] < wide[2] < 64

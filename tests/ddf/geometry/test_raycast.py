"""Ray casting: the tree, and rational numbers of all triangles one by one, on the same questions."""

import numpy as np
import pytest
import torch
from _shapes import cube, icosphere, joined, moved, random_rays, torus
from _support import assert_close

from bench.lib import exact_cast
from ddf.geometry import mesh_io, primitives, raycast, rays

PATHS = {"tree": raycast.cast, "one by one": exact_cast.cast}


@pytest.fixture(params=PATHS, name="cast")
def _cast(request):
    return PATHS[request.param]


def test_box_hits_equal_closed_form(cast):
    points = random_rays(600, seed=1, spread=2.0)
    hits, truth = cast(cube(0.9), points), primitives.cast(primitives.Box((-0.9, -0.9, -0.9), (0.9, 0.9, 0.9)), points)
    assert (hits.visible == truth.visible).all() and 100 < hits.visible.sum() < 500
    assert_close(hits.depth, truth.depth, atol=1e-9)
    assert_close(hits.normals, truth.normals, atol=1e-9)
    assert (hits.face >= 0).eq(hits.visible).all()


def test_no_rays_and_empty_mesh(cast):
    empty = mesh_io.Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    hits = cast(empty, random_rays(4, seed=6))
    assert not hits.visible.any() and torch.isinf(hits.depth).all() and (hits.normals == 0).all()
    none = cast(cube(), rays.OrientedPoints(torch.zeros(0, 3), torch.zeros(0, 3)))
    assert none.depth.shape == (0,) and none.normals.shape == (0, 3)


def test_batch_shape_is_kept(cast):
    points = random_rays(12, seed=7)
    folded = rays.OrientedPoints(points.positions.reshape(3, 4, 3), points.directions.reshape(3, 4, 3))
    assert_close(cast(cube(), folded).depth, cast(cube(), points).depth.reshape(3, 4))
    assert cast(cube(), folded).normals.shape == (3, 4, 3)


@pytest.mark.parametrize(("size", "place"), [(0.8, (0.0, 0.0, 0.0)), (3.0, (100.0, 0.0, -5.0))])
def test_distance_equals_closed_form_of_box_and_closest_points_lie_on_it(size, place):
    points = np.random.default_rng(0).uniform(-2, 2, (300, 3)) * size + place
    beyond = np.abs(points - place) - size
    inside = (beyond < 0).all(axis=1)
    expected = np.where(inside, -beyond.max(axis=1), np.linalg.norm(beyond.clip(0), axis=1))
    scene = raycast.Scene(moved(cube(), size, place))
    assert_close(scene.distance(points), expected, atol=1e-12)
    assert scene.distance(scene.closest(points)).max() < 1e-12
    assert (scene.outside(points) == ~inside).all()


def test_closest_point_of_a_triangle_equals_dense_search():
    rng = np.random.default_rng(11)
    corners, points = rng.standard_normal((60, 3, 3)), 2 * rng.standard_normal((60, 3))
    grid = np.linspace(0, 1, 201)
    u, v = (g.ravel() for g in np.meshgrid(grid, grid))
    u, v = u[u + v <= 1], v[u + v <= 1]
    weights = np.stack([1 - u - v, u, v], axis=1)
    dense = np.linalg.norm(weights @ corners - points[:, None], axis=2).min(axis=1)
    scenes = [raycast.Scene(mesh_io.Mesh(each, np.array([[0, 1, 2]]))) for each in corners]
    found = np.array([float(s.distance(p[None])[0]) for s, p in zip(scenes, points, strict=True)])
    assert (found <= dense + 1e-12).all()
    assert_close(found, dense, atol=2e-3, rtol=5e-3)


def test_visibility_from_outside_of_nested_spheres_and_cup():
    mesh = joined(icosphere(3, 0.9), icosphere(2, 0.4))
    corners = mesh.triangles.mean(axis=1)
    seen = raycast.visible_from_outside(raycast.Scene(mesh), corners, np.arange(len(corners)))
    assert (seen == (np.linalg.norm(corners, axis=1) > 0.6)).all()
    open_cube = mesh_io.Mesh(cube().vertices, cube().faces[cube().triangles.mean(axis=1)[:, 1] < 0.9])
    middle = open_cube.triangles.mean(axis=1)
    assert raycast.visible_from_outside(raycast.Scene(open_cube), middle, np.arange(len(middle))).all()


def test_spread_directions_are_unit_and_balanced():
    directions = rays.evenly_spread(64)
    assert_close(np.linalg.norm(directions, axis=1), np.ones(64))
    assert np.linalg.norm(directions.mean(axis=0)) < 0.02
    nearest = np.sort(directions @ directions.T, axis=1)[:, -2]
    assert np.degrees(np.arccos(nearest)).min() > 15  # 64 even directions are about 26 degrees apart


def test_a_face_just_behind_a_start_is_met_at_depth_0_where_that_is_asked_for():
    scene = raycast.Scene(cube(1.0))
    local = np.array([[0.3, -1 + 1e-6, 0.2, 0, 1, 0], [0.3, 0.0, 0.2, 0, 1, 0]], np.float32)
    np.testing.assert_allclose(scene.cast_local(local)[0], [2, 1], atol=2e-6)
    np.testing.assert_allclose(scene.cast_local(local, raycast.SURFACE_OFFSET)[0], [0, 1], atol=2e-6)


def _beside_edges(mesh, count, seed):
    """Rays to points beside edges, 1e-9 to 1e-6 of the size away from them."""
    rng = np.random.default_rng(seed)
    faces = mesh.faces[rng.integers(0, len(mesh.faces), count)]
    share = rng.random((count, 1))
    away = rng.standard_normal((count, 3)) * 10 ** rng.uniform(-9, -6, (count, 1))
    target = mesh.vertices[faces[:, 0]] * share + mesh.vertices[faces[:, 1]] * (1 - share) + away
    positions = rng.uniform(-1.5, 1.5, (count, 3))
    directions = target - positions
    return positions, directions / np.linalg.norm(directions, axis=1, keepdims=True)


SOUP = joined(cube(0.5), moved(icosphere(1), 0.6, (0.4, 0.1, 0.0)), moved(torus(sections=8), 0.7, (-0.4, 0.2, 0.3)))


def test_depths_and_faces_beside_edges_are_those_of_rational_numbers():
    positions, directions = _beside_edges(SOUP, 200, seed=1)
    points = rays.OrientedPoints(positions, directions)
    found, truth = raycast.cast(SOUP, points), exact_cast.cast(SOUP, points)
    np.testing.assert_allclose(found.depth, truth.depth, rtol=1e-9)
    np.testing.assert_array_equal(found.face, truth.face)
    assert np.isfinite(truth.depth).sum() > 125


def test_needles_are_found_between_their_neighbours():
    width = 3e-7
    corners = np.array([[-1, -1, 0], [0, -1, 0], [0, 1, 0], [-1, 1, 0], [width, -1, 0.5], [width, 1, 0.5], [1, 0, 0.7]])
    mesh = mesh_io.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2], [2, 4, 5], [4, 6, 5]]))
    x = np.array([width / 4, width / 2, width * 0.9])
    positions = np.stack([x, np.zeros(3), np.full(3, 2.0)], axis=1)
    directions = np.tile([0.0, 0.0, -1.0], (3, 1))
    depth, face = raycast.Scene(mesh).first_hits(positions, directions)
    np.testing.assert_allclose(depth, 2 - 0.5 * x / width, rtol=1e-9)
    assert set(face) <= {2, 3}


def test_starts_on_a_face_are_decided_exactly():
    start = np.array([[0.2, 0.1, 1.0], [0.2, 0.1, np.nextafter(1, 2)], [0.2, 0.1, np.nextafter(1, 0)]])
    depth, _ = raycast.Scene(cube()).first_hits(start, np.tile([0.0, 0.0, 1.0], (3, 1)))
    assert depth[0] == 0 and np.isinf(depth[1]) and 0 < depth[2] < 1e-15


def test_one_pair_in_rational_numbers_is_met_where_its_weights_say():
    """Whole numbers: the ray of length 1 ends at a point of the triangle's plane, which its weights tell."""
    rng = np.random.default_rng(3)
    corners, starts = rng.integers(-9, 10, (400, 3, 3)), rng.integers(-9, 10, (400, 3))
    weights = rng.integers(-1, 6, (400, 3))
    weights[:, 2] = 8 - weights[:, :2].sum(axis=1)
    ways = np.einsum("kc,kcx->kx", weights, corners) / 8 - starts
    steep = np.einsum("kx,kx->k", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), ways) != 0
    inside = (weights >= 0).all(axis=1)
    assert (steep & inside).sum() > 100 < (steep & ~inside).sum() and not steep.all()
    for p, v, t, meets in zip(starts.tolist(), ways.tolist(), corners.tolist(), steep & inside, strict=True):
        assert exact_cast.meet(p, v, t) == (1 if meets else np.inf)
        assert exact_cast.meet(p, [-x for x in v], t) == np.inf  # it lies behind

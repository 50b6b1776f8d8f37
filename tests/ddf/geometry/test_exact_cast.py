"""Ray casting beside edges and on faces: against rational numbers."""

import numpy as np
from _shapes import cube, icosphere, joined, moved, torus

from bench.lib import exact_cast
from ddf.geometry import mesh_io, raycast, rays


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

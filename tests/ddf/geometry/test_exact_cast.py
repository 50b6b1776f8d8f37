"""Ray casting beside edges and on faces: against rational numbers."""

from fractions import Fraction

import numpy as np
import pytest
from _shapes import cube, icosphere, joined, moved, torus

from bench.lib import exact_cast
from ddf.geometry import mesh_io, raycast, rays


def _solve(matrix, right):
    """Cramer's rule in rational numbers: another way than the module's."""

    def det(m):
        (a, b, c), (d, e, f), (g, h, i) = m
        return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)

    whole = det(matrix)
    if whole == 0:
        return None
    return [det([[right[r] if c == k else matrix[r][c] for c in range(3)] for r in range(3)]) / whole for k in range(3)]


def _rational_depth(position, direction, triangles):
    """First t >= 0 with p + t v = a + u (b - a) + w (c - a), u, w, 1 - u - w >= 0."""
    p, v = ([Fraction(x) for x in vector] for vector in (position, direction))
    best = None
    for triangle in triangles:
        a, b, c = ([Fraction(x) for x in corner] for corner in triangle)
        matrix = [[b[i] - a[i], c[i] - a[i], -v[i]] for i in range(3)]
        found = _solve(matrix, [p[i] - a[i] for i in range(3)])
        if found is not None:
            u, w, t = found
            if u >= 0 and w >= 0 and u + w <= 1 and t >= 0 and (best is None or t < best):
                best = t
    return np.inf if best is None else float(best)


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


def test_depths_beside_edges_are_those_of_rational_numbers():
    positions, directions = _beside_edges(SOUP, 40, seed=0)
    depth, face = raycast.Scene(SOUP).first_hits(positions, directions)
    triangles = SOUP.triangles.tolist()
    truth = np.array([_rational_depth(p, v, triangles) for p, v in zip(positions, directions, strict=True)])
    np.testing.assert_allclose(depth, truth, rtol=1e-9)
    assert ((face >= 0) == np.isfinite(truth)).all() and np.isfinite(truth).sum() > 25


def test_faces_beside_edges_are_those_of_rational_numbers():
    positions, directions = _beside_edges(SOUP, 200, seed=1)
    points = rays.OrientedPoints(positions, directions)
    found, truth = raycast.cast(SOUP, points), exact_cast.cast(SOUP, points)
    np.testing.assert_allclose(found.depth, truth.depth, rtol=1e-9)
    np.testing.assert_array_equal(found.face, truth.face)


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


def test_one_pair_in_rational_numbers_is_that_of_cramers_rule():
    rng = np.random.default_rng(3)
    triangles = rng.standard_normal((200, 3, 3))
    inside = np.einsum("kc,kcx->kx", rng.dirichlet([0.1] * 3, 200), triangles)
    positions = inside + rng.standard_normal((200, 3))
    directions = inside - positions
    directions[::5] = triangles[::5, 1] - triangles[::5, 0]  # in a plane beside the triangle's
    for p, v, t in zip(positions.tolist(), directions.tolist(), triangles.tolist(), strict=True):
        assert exact_cast.meet(p, v, t) == pytest.approx(_rational_depth(p, v, [t]), rel=1e-12)

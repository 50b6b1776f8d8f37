"""Ground-truth clouds: spacing, counts, uniformity, hidden points, seeds."""

import numpy as np
import pytest
from _shapes import cube, icosphere, joined, moved
from scipy import spatial

from ddf.data import true_clouds
from ddf.geometry import mesh_io


@pytest.mark.parametrize("mesh", [cube(), joined(icosphere(3), moved(cube(), 0.5, (0.9, 0, 0)))], ids=["cube", "soup"])
def test_count_is_met_and_no_two_points_are_close(mesh):
    points, face = true_clouds.poisson_disk(mesh, 2000, np.random.default_rng(0))
    assert 1800 <= len(points) <= 2200
    tree = spatial.cKDTree(points)
    nearest = tree.query(points, k=2)[0][:, 1]
    _, areas = mesh_io.face_normals(mesh)
    even = np.sqrt(areas.sum() / len(points))
    assert nearest.min() > 0.6 * even  # white noise would fall to under 0.05
    share = np.bincount(face, minlength=len(areas)) / len(face)
    big = areas > 0.02 * areas.sum()
    assert (np.abs(share - areas / areas.sum())[big] < 0.02).all()


def test_poisson_disk_covers_the_surface():
    points, _ = true_clouds.poisson_disk(cube(), 2000, np.random.default_rng(0))
    probes = np.random.default_rng(1).uniform(-1, 1, (3000, 3))
    probes[np.arange(3000), np.random.default_rng(2).integers(0, 3, 3000)] = 1.0
    gap = spatial.cKDTree(points).query(probes)[0].max()
    assert gap < 2 * np.sqrt(24 / 2000)


@pytest.mark.parametrize("width", [1e-3, 1e-9])
def test_slivers_get_their_points_whatever_their_width(width):
    """All area on a thread: the radius is a tiny share of the box."""
    corners = np.array([[-1.0, 0, 0], [1.0, 0, 0], [1.0, width, 0], [-1.0, width, 0]])
    thread = mesh_io.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    points, _ = true_clouds.poisson_disk(thread, 300, np.random.default_rng(4))
    assert 270 <= len(points) <= 330
    gaps = np.diff(np.sort(points[:, 0]))
    assert gaps.max() < 8 * 2 / 300


def test_inner_sphere_is_hidden_and_stays_in_the_cloud():
    cloud = true_clouds.draw(joined(icosphere(4, 0.9), icosphere(4, 0.4)), 2000, np.random.default_rng(0))
    inner = np.linalg.norm(cloud.points, axis=1) < 0.6
    assert inner.any() and (cloud.hidden == inner).all()
    assert abs(cloud.hidden.mean() - 0.16 / (0.16 + 0.81)) < 0.03


def test_equal_seeds_give_equal_clouds():
    first, again, other = (true_clouds.draw(cube(), 500, np.random.default_rng(seed)).points for seed in (1, 1, 2))
    assert first.shape == again.shape and (first == again).all()
    assert first.shape != other.shape or not (first == other).all()

"""Scores of surfaces: two concentric spheres in closed form, and a sheet turned against another."""

import numpy as np
import pytest
from _shapes import icosphere

from ddf.geometry.mesh_io import Mesh
from ddf.metrics import cloud_scores


def test_concentric_spheres_lie_their_difference_apart():
    found = cloud_scores.compare_meshes(icosphere(4, 1.0), icosphere(4, 0.9), points=4000)
    assert found.chamfer_l1 == pytest.approx(0.1, abs=0.01)
    assert found.clouds.chamfer_l2_sq == pytest.approx(2 * 0.1**2, rel=0.15)
    assert found.normal_consistency > 0.99 and found.watertight


def test_crossed_squares_disagree_in_their_normals():
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    found = cloud_scores.compare_meshes(Mesh(corners, faces), Mesh(corners[:, [0, 2, 1]], faces), points=500)
    assert found.normal_consistency < 1e-9 and not found.watertight

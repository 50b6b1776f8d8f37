"""Meshes of exact fields: a sphere both ways, an open room that stays open."""

import numpy as np
import pytest
import trimesh
from _closed_form import ClosedForm

from ddf.core import checks
from ddf.fields import checked_cloud
from ddf.fit import surfaces
from ddf.geometry import primitives

SPHERE = ClosedForm(primitives.Sphere(radius=0.8))


@pytest.fixture(scope="module")
def cloud():
    return checked_cloud.draw(SPHERE, 20_000)


@pytest.mark.parametrize("method", surfaces.METHODS)
def test_a_sphere_is_found_each_way(method, cloud):
    if method == "closed":
        mesh = surfaces.closed(SPHERE, 48)
    else:
        mesh = surfaces.extract(SPHERE, cloud, method, hits=2000, resolution=24)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 0.8, atol=0.03)
    shape = trimesh.Trimesh(mesh.vertices, mesh.faces)
    assert shape.area == pytest.approx(4 * np.pi * 0.64, rel=0.06)


def test_a_field_without_normals_is_told(cloud):
    blind = ClosedForm(primitives.Sphere((9.0, 0.0, 0.0)))
    with pytest.raises(checks.InputError, match="gives no normals"):
        surfaces.extract(blind, cloud, "poisson", hits=10)

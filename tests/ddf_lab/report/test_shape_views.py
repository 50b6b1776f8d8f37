"""Pictures of a fitted field: where the cameras stand, and truth and field at the same rays."""

import _models
import numpy as np
import pytest
from _shapes import icosphere

from ddf.fields import shape_field
from ddf.geometry import mesh_io, primitives
from ddf_lab.report import beside

SPHERE = primitives.Sphere((0.0, 0.0, 0.0), 0.45)


@pytest.fixture(scope="module")
def shape(tmp_path_factory):
    return shape_field.load(_models.write_shape_field(tmp_path_factory.mktemp("field")))


@pytest.fixture(scope="module")
def ball(shape):
    """A sphere of radius 0.45 about the centre of the field's box, in the frame of the mesh."""
    mesh = icosphere(5, 0.45)
    return mesh_io.Mesh(shape.field_from_mesh.inverse().apply(mesh.vertices), mesh.faces)


def test_errors_are_those_of_rays_that_both_see():
    turned = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found = {
        "depth": np.array([1.0, 2.0, 4.0, np.inf]),
        "true_depth": np.array([1.5, 2.0, np.inf, np.inf]),
        "normals": turned,
        "true_normals": np.tile([1.0, 0.0, 0.0], (4, 1)),
    }
    assert beside.errors(found) == pytest.approx({"median": 0.25, "mean": 0.25, "wrong": 0.25, "angle": 45.0})

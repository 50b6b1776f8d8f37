"""Pictures of a fitted field: where the cameras stand, and truth and field at the same rays."""

import _models
import numpy as np
import pytest
import torch
from _shapes import icosphere
from _support import assert_close

from ddf.fields import shape_field
from ddf.geometry import mesh_io, primitives, raycast, rays
from ddf_lab.report import beside, shape_views

SPHERE = primitives.Sphere((0.0, 0.0, 0.0), 0.45)


@pytest.fixture(scope="module")
def shape(tmp_path_factory):
    return shape_field.load(_models.write_shape_field(tmp_path_factory.mktemp("field")))


@pytest.fixture(scope="module")
def ball(shape):
    """A sphere of radius 0.45 about the centre of the field's box, in the frame of the mesh."""
    mesh = icosphere(5, 0.45)
    return mesh_io.Mesh(shape.field_from_mesh.inverse().apply(mesh.vertices), mesh.faces)


@pytest.mark.parametrize("direction", shape_views.DIRECTIONS)
def test_slices_ask_at_points_of_the_plane_inside_the_box(shape, ball, direction):
    size, scale = 20, shape.field_from_mesh.scale
    found = shape_views.slice_of(shape, raycast.Scene(ball), 0.5, direction, size)
    steps = (np.arange(size) + 0.5) / size * 2 - 1
    p = np.stack([np.tile(steps, (size, 1)), np.tile(-steps[:, None], (1, size)), np.zeros((size, size))], axis=-1)
    p = p.reshape(-1, 3)
    v = np.tile(np.array(direction) / np.linalg.norm(direction), (len(p), 1))
    inside = np.abs(p[:, 1]) <= 0.5
    hits = primitives.cast(SPHERE, rays.OrientedPoints(torch.from_numpy(p), torch.from_numpy(v)))
    expected = np.where(inside, hits.depth.numpy(), np.inf)
    off = beside.errors({"depth": expected, "true_depth": scale * found["true_depth"]})
    assert np.isfinite(expected).sum() > 40 and off["median"] < 5e-3 and off["wrong"] < 0.05
    with torch.no_grad():
        raw = shape.field(torch.from_numpy(p[inside]).float(), torch.from_numpy(v[inside]).float())
    assert_close(found["visibility"][inside], torch.sigmoid(raw[:, 3]), atol=1e-5)
    seen = found["visibility"][inside] >= 0.5
    assert_close(found["weight_1"][inside][seen], torch.sigmoid(raw[:, 2]).numpy()[seen], atol=1e-5)
    assert not found["visibility"][~inside].any()


def test_errors_are_those_of_rays_that_both_see():
    turned = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    found = {
        "depth": np.array([1.0, 2.0, 4.0, np.inf]),
        "true_depth": np.array([1.5, 2.0, np.inf, np.inf]),
        "normals": turned,
        "true_normals": np.tile([1.0, 0.0, 0.0], (4, 1)),
    }
    assert beside.errors(found) == pytest.approx({"median": 0.25, "mean": 0.25, "wrong": 0.25, "angle": 45.0})

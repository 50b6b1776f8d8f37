"""A field file and what is asked of it: frames, units, rays that miss, far cameras; no training needed."""

import numpy as np
import pytest
import torch
from _models import FIELD, FRAME, LOWER, UPPER, write_shape_field
from torch.nn import functional

from ddf.core import checks, storage
from ddf.fields import derivatives, field_outputs, field_values, framed_field, pddf, shape_field
from ddf.fields.model_files import MODEL
from ddf.geometry import rays


@pytest.fixture
def shape(tmp_path):
    return shape_field.load(write_shape_field(tmp_path))


def _rays(count=60, seed=0, spread=0.9):
    """Field-frame rays that start in the box."""
    generator = torch.Generator().manual_seed(seed)
    upper = torch.from_numpy(UPPER)
    p = spread * upper * (2 * torch.rand(count, 3, generator=generator, dtype=torch.float64) - 1)
    return p, functional.normalize(torch.randn(count, 3, generator=generator, dtype=torch.float64), dim=-1)


def _in_mesh_frame(p, v):
    return rays.OrientedPoints(torch.from_numpy(FRAME.inverse().apply(p.numpy())), v)


def test_file_and_folder_load_the_same_field(tmp_path):
    folder = write_shape_field(tmp_path / "field")
    one, two = shape_field.load(folder), shape_field.load(folder / MODEL)
    assert torch.equal(one.field.network.head.weight, two.field.network.head.weight)
    assert one.field_from_mesh.to_dict() == FRAME.to_dict()
    assert np.array_equal(one.lower, LOWER)
    assert np.array_equal(one.upper, UPPER)
    assert one.record["format_version"] == storage.FORMAT_VERSION


def _hidden(*widths):
    return {"field": {**shape_field.asdict(FIELD), "hidden": list(widths)}}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kind": "ddf"}, "holds no field of a single shape"),
        ({"box": {"lower": [0, 0, 0]}}, "its record lacks what a field needs"),
        ({"field": {"hidden": [16, 16]}}, "its record lacks what a field needs"),
        ({"box": {"lower": [0, 0, 0], "upper": [1, 0, 1]}}, "lower must be below upper"),
        ({"format_version": 999}, "its format version is 999; this version of ddf reads 1: update ddf"),
        (_hidden(16, 8), "does not fit the architecture"),
        (_hidden(1 << 20, 1 << 20), "does not fit the architecture"),
        (_hidden(*[1 << 62] * 3), "describes no model"),
        (_hidden(*[8] * 1000), "lacks what a field needs"),
    ],
)
def test_other_files_are_refused(tmp_path, changes, message):
    with pytest.raises(checks.InputError, match=message):
        shape_field.load(write_shape_field(tmp_path, **changes))
    with pytest.raises(FileNotFoundError, match="no such field"):
        shape_field.load(tmp_path / "nothing")


def test_weights_that_are_not_finite_are_refused(tmp_path):
    write_shape_field(tmp_path)
    tensors, record = storage.load_tensors(tmp_path / MODEL)
    tensors["network.head.bias"] = tensors["network.head.bias"] * np.nan
    storage.save_tensors(tmp_path / MODEL, tensors, record)
    with pytest.raises(checks.InputError, match=r"network\.head\.bias holds values that are not finite"):
        shape_field.load(tmp_path)


def test_answers_are_those_of_the_network_in_the_unit_of_the_mesh(shape):
    p, v = _rays()
    found, evaluated = framed_field.query(shape, _in_mesh_frame(p, v), tuple(field_outputs.OUTPUTS))
    with torch.no_grad():
        raw = shape.field(p.float(), v.float())
        surface = derivatives.Surface(shape.field.requires_grad_(False), p.float(), v.float())
    seen = (pddf.visibility(raw) >= 0.5).numpy()
    assert 0 < seen.sum() < len(seen)
    assert evaluated == len(p)
    np.testing.assert_allclose(found["visibility"], pddf.visibility(raw), rtol=1e-4)
    np.testing.assert_allclose(found["depth"][seen], 50 * shape.field.depth(raw).numpy()[seen], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(found["normals"][seen], surface.normals.numpy()[seen], atol=1e-4)
    np.testing.assert_allclose(found["mean_curvature"][seen], surface.mean.numpy()[seen] / 50, rtol=1e-2, atol=1e-5)
    gaussian = surface.gaussian.numpy()[seen] / 2500
    np.testing.assert_allclose(found["gaussian_curvature"][seen], gaussian, rtol=1e-2, atol=1e-6)
    assert bool(np.isinf(found["depth"][~seen]).all())
    for name in ("normals", "mean_curvature", "gaussian_curvature"):
        assert not found[name][~seen].any()


@pytest.mark.parametrize("away", [5.0, 2000.0])
def test_starting_further_back_adds_that_to_the_depth(shape, away):
    p, v = _rays()
    upper = torch.from_numpy(UPPER)
    entry, _, _ = rays.enter_box(p - 10 * v, v, -upper, upper)
    near, _ = framed_field.query(shape, _in_mesh_frame(entry, v), ["depth", "normals"])
    far, evaluated = framed_field.query(shape, _in_mesh_frame(entry - away * v, v), ["depth", "normals"])
    assert evaluated == len(p)
    seen = np.isfinite(near["depth"])
    assert seen.any()
    assert np.array_equal(seen, np.isfinite(far["depth"]))
    np.testing.assert_allclose(far["depth"][seen] - 50 * away, near["depth"][seen], atol=1e-3)
    np.testing.assert_allclose(far["normals"], near["normals"], atol=1e-3)


def test_rays_that_miss_the_box_are_never_evaluated(shape, monkeypatch):
    p = torch.tensor([[0.0, 0.0, 3.0], [0.0, 0.0, 3.0], [0.0, 0.7, 3.0], [0.0, 0.0, 0.0]], dtype=torch.float64)
    v = torch.tensor([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]], dtype=torch.float64)
    counted = []
    forward = field_values.evaluate
    monkeypatch.setattr(field_values, "evaluate", lambda f, a, *b: counted.append(len(a)) or forward(f, a, *b))
    found, evaluated = framed_field.query(shape, _in_mesh_frame(p, v), tuple(field_outputs.OUTPUTS))
    assert sum(counted) == evaluated == 2  # behind the camera, and beside the box: components of exactly 0
    assert found["visibility"][[0, 2]].tolist() == [0.0, 0.0]
    assert (found["visibility"][[1, 3]] > 0).all() and np.isinf(found["depth"][[0, 2]]).all()
    assert not any(np.isnan(values).any() for values in found.values())
    none = torch.zeros(0, 3, dtype=torch.float64)
    found, evaluated = framed_field.query(shape, rays.OrientedPoints(none, none), tuple(field_outputs.OUTPUTS))
    assert evaluated == 0 and [found[name].shape for name in field_outputs.DEFAULT] == [(0,), (0,), (0, 3)]


@pytest.mark.parametrize("up", ["y", "z"])
def test_camera_at_a_point_stands_there(shape, up):
    for place in (np.array([0.3, -0.2, 0.7]), np.array([0.0, 0.4, 0.0]), np.zeros(3)):
        starts, _ = framed_field.camera_rays(shape, framed_field.camera_at(shape, place, up), 2, up)
        np.testing.assert_allclose(starts[0], place, atol=1e-12)


@pytest.mark.parametrize("up", ["y", "z"])
def test_camera_looks_at_the_centre_with_its_axis_up(shape, up):
    starts, directions = framed_field.camera_rays(shape, (30.0, 25.0, 1.0), 8, up)
    centre = (shape.lower + shape.upper) / 2
    diagonal = np.linalg.norm(shape.upper - shape.lower)
    ahead = directions.mean(axis=0)
    np.testing.assert_allclose(np.linalg.norm(starts[0] - centre), diagonal / 0.57, rtol=1e-12)
    np.testing.assert_allclose(ahead / np.linalg.norm(ahead), (centre - starts[0]) / (diagonal / 0.57), atol=1e-12)
    axis = {"y": 1, "z": 2}[up]
    assert starts[0, axis] > centre[axis]
    assert directions[:8, axis].mean() > directions[-8:, axis].mean()  # the first row looks higher


@pytest.mark.parametrize("radius", [0.0, 0.05, 0.285, 1.0, 570.0])
def test_renders_are_finite_from_inside_on_and_far_from_the_box(shape, radius):
    images, evaluated = framed_field.render(shape, (90.0, 0.0, radius), 12, tuple(field_outputs.OUTPUTS))
    assert evaluated <= 144
    assert radius == 570.0 or evaluated > 0
    for name, image in images.items():
        assert image.shape[:2] == (12, 12) and not np.isnan(image).any(), name
        assert name == "depth" or np.isfinite(image).all(), name


def test_points_are_seeded_and_in_the_mesh_frame(shape):
    points = shape.points(40, 3)
    assert points.shape == (40, 3)
    assert np.array_equal(points, shape.points(40, 3))
    assert not np.array_equal(points, shape.points(40, 4))
    assert np.abs(FRAME.apply(points)).max() < 5  # near the box in field units
    with pytest.raises(checks.InputError, match="number of points must be >= 1; got 0"):
        shape.points(0)

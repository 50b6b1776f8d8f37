"""ONNX files of fields and models: values, rows, outputs, what they say of themselves, and what is refused."""

import json
import sys
from pathlib import Path

import _models
import numpy as np
import onnx
import pytest
import torch
from _support import assert_close

from ddf.core import extras, storage
from ddf.fields import field_outputs, field_values
from ddf.io import onnx_file, onnx_graphs, onnx_parity
from ddf.models import line_field

ALL = tuple(field_outputs.OUTPUTS)
SOURCE = {"source": "chair/model.safetensors", "source_sha256": "0" * 64, "config": {"kind": "ddf"}}
QUICK = onnx_file.ExportConfig(ALL, (1, 7))


def _run(data, inputs, names):
    return onnx_parity.run(onnx_parity.session(data), inputs, names)


@pytest.mark.parametrize("activation", ["relu", "softplus"])
def test_plain_field_gives_float64_values_at_any_length(activation):
    graph = onnx_graphs.FieldGraph(_models.field(activation), ALL)
    data = onnx_file.to_onnx(graph, SOURCE)
    for count in (1, 7, 300):
        positions, directions = _models.points(count, seed=count)
        found = _run(data, {"positions": positions, "directions": directions}, ALL)
        field, names = _models.field(activation).double(), [name for name in ALL if "curvature" not in name]
        truth = field_values.evaluate(field, positions.double(), directions.double(), names)
        for name, value in truth.items():
            assert_close(found[name], value, atol=2e-5 if name.startswith("normals") else 2e-6, rtol=0.0)


@pytest.mark.parametrize(("activation", "sign"), [("relu", 1), ("relu", -1), ("softplus", 1), ("softplus", -1)])
def test_saturated_visibility_and_depth_of_zero_are_exact(activation, sign):
    field = _models.field(activation)
    with torch.no_grad():
        field.network.head.bias[3] = 300.0 * sign  # exp overflows in float32
        field.network.head.bias[:2] = -300.0
    positions, directions = onnx_parity.box_rays()
    data = onnx_file.to_onnx(onnx_graphs.FieldGraph(field, ALL), SOURCE)
    found = _run(data, {"positions": positions, "directions": directions}, ALL)
    assert (found["visibility"] == (1.0 if sign > 0 else 0.0)).all()
    assert (found["depth"] == 0.0).all()
    assert np.isfinite(found["normals"]).all()
    assert_close(np.linalg.norm(found["normals"], axis=-1), np.ones(len(positions)))


def test_every_graph_of_a_model_agrees_with_torch(tmp_path):
    for name, graph in onnx_graphs.ddf_graphs(_models.ddf_model(), 32, ALL).items():
        rows = onnx_file.export(graph, name, tmp_path / f"{name}.onnx", SOURCE, QUICK)
        assert {row.output for row in rows} == set(graph.meanings)
        assert max(row.max_abs / row.tolerance for row in rows) < 1
        hard = {"hard"} if "positions" in graph.inputs else set()
        assert {row.cases for row in rows} == {"random 1", "random 7"} | hard


@pytest.mark.parametrize("told", [False, True])
def test_azimuth_from_sine_and_cosine_agrees_with_torch(tmp_path, told):
    graph = onnx_graphs.EncodersGraph(_models.ddf_model("sincos", told), 32)
    rows = onnx_file.export(graph, "encoders", tmp_path / "encoders.onnx", SOURCE, QUICK)
    assert max(row.max_abs / row.tolerance for row in rows) < 1
    images = onnx_graphs.example_images(7, 32, torch.Generator().manual_seed(1))
    (camera,) = _run((tmp_path / "encoders.onnx").read_bytes(), {"images": images}, ("camera",)).values()
    assert len(set(camera[:, 0])) == 7 and (camera[:, 0] > 0).any()


def test_file_says_what_it_is(tmp_path):
    folder = _models.write_model(tmp_path / "chair")
    graphs, source = onnx_file.load_graphs(folder, ALL)
    model = onnx.load_from_string(onnx_file.to_onnx(graphs["field"], source))
    found = {entry.key: entry.value for entry in model.metadata_props}
    assert [(entry.domain, entry.version) for entry in model.opset_import] == [("", onnx_file.OPSET)]
    assert (model.producer_name, model.producer_version) == ("ddf", extras.version()) == ("ddf", found["ddf_version"])
    assert found["source"] == "chair/model.safetensors"
    assert found["source_sha256"] == storage.checksum(folder / "model.safetensors")
    assert json.loads(found["box"]) == [[-1, -1, -1], [1, 1, 1]] and json.loads(found["config"])["hidden"][0] == 24
    assert set(json.loads(found["outputs"])) == set(ALL) and found["transform"].startswith("none")
    assert found["model_license"] == "MIT"


def test_equal_models_give_equal_bytes_without_places_of_this_machine():
    graphs = (onnx_graphs.ddf_graphs(_models.ddf_model(), 32, ALL)["field"] for _ in range(2))
    first, second = (onnx_file.to_onnx(graph, SOURCE) for graph in graphs)
    assert first == second and str(Path.cwd()).encode() not in first and sys.prefix.encode() not in first


def _with_one_weight_changed(data):
    model = onnx.load_from_string(data)
    largest = max(model.graph.initializer, key=lambda tensor: len(tensor.raw_data))
    values = onnx.numpy_helper.to_array(largest).copy()
    values.flat[3] += 1e-2
    largest.CopyFrom(onnx.numpy_helper.from_array(values, largest.name))
    return model.SerializeToString()


def test_file_that_differs_from_its_model_is_refused_and_leaves_nothing(tmp_path, monkeypatch):
    graph = onnx_graphs.FieldGraph(_models.field(), ALL)
    right = onnx_file.to_onnx
    monkeypatch.setattr(onnx_file, "to_onnx", lambda *args: _with_one_weight_changed(right(*args)))
    with pytest.raises(onnx_parity.ParityError, match=r"field: onnxruntime and torch must agree on \w+ within"):
        onnx_file.export(graph, "field", tmp_path / "field.onnx", SOURCE, QUICK)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "field.onnx").write_bytes(b"earlier")
    with pytest.raises(onnx_parity.ParityError):
        onnx_file.export(graph, "field", tmp_path / "field.onnx", SOURCE, QUICK)
    assert (tmp_path / "field.onnx").read_bytes() == b"earlier"


def test_files_give_what_the_field_of_the_image_gives(tmp_path):
    folder, sessions = _models.write_model(tmp_path / "chair", "ddf_image"), {}
    graphs, source = onnx_file.load_graphs(folder, None)
    assert list(graphs) == ["rays", "encode"] and source["config"]["kind"] == line_field.KIND
    for name, graph in graphs.items():
        config = onnx_file.ExportConfig(batches=(1, 7, 500))
        rows = onnx_file.export(graph, name, tmp_path / "graph.onnx", source, config)
        assert {row.output for row in rows} == set(graph.meanings)
        sessions[name] = onnx_parity.session((tmp_path / "graph.onnx").read_bytes())
    model = line_field.load(folder).network
    image = onnx_graphs.example_images(1, 32, torch.Generator().manual_seed(5))
    with torch.no_grad():
        views = model.views(image, model.camera_head(model.camera_encoder(image)))
    names = ("features", "context", "opaque", "camera")
    encoded = onnx_parity.run(sessions["encode"], {"images": image}, names)
    for name, part in zip(names, (views.features, views.context, views.opaque, views.cameras), strict=True):
        assert_close(encoded[name], part[:, 0], atol=1e-5, rtol=1e-5)
    positions, directions = _models.points(400)
    inputs = {"image": image, **{name: torch.from_numpy(part) for name, part in encoded.items()}}
    inputs |= {"positions": positions, "directions": directions}
    found = onnx_parity.run(sessions["rays"], inputs, ("visibility", "depth"))
    field = line_field.ImageField.of(model.decoder, views)
    expected = field.evaluate(positions.numpy(), directions.numpy(), ("visibility", "depth"))
    assert 0.05 < (expected["visibility"] > 0.5).mean() < 0.95
    for name, values in found.items():
        assert np.quantile(np.abs(values - expected[name]), 0.99) < 1e-4  # a ray may pass between two pixels

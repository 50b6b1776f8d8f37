"""`ddf export` to ONNX."""

import json

import _models
import onnx
import pytest

from ddf.cli import models
from ddf.fields import field_outputs, model_files


@pytest.fixture(autouse=True)
def few_rays(monkeypatch):
    monkeypatch.setattr(models, "BATCHES", (1, 7))


@pytest.fixture
def folder(tmp_path):
    return _models.write_model(tmp_path / "chair")


def test_export_reports_parity_and_opset(folder, tmp_path, answer):
    out = tmp_path / "field.onnx"
    result = answer("export", folder / model_files.MODEL, out)
    assert result["opset"] == 18 and set(result["parity"]) == set(field_outputs.OUTPUTS)
    assert all(0 < entry["max_abs"] <= entry["tolerance"] for entry in result["parity"].values())
    assert result["inputs"] == {"positions": ["n", 3], "directions": ["n", 3], "latent": [1, 6]}
    assert result["bytes"] == out.stat().st_size
    onnx.checker.check_model(out)


def test_outputs_and_graph_are_chosen(folder, tmp_path, answer):
    out = tmp_path / "out.onnx"
    assert set(answer("export", folder, out, "--outputs", "visibility")["parity"]) == {"visibility"}
    result = answer("export", folder, out, "--graph", "encoders")
    assert result["graph"] == "encoders"
    assert set(result["parity"]) == {"latent", "camera"}


def test_a_fitted_field_is_exported_with_its_box_and_frame(tmp_path, answer):
    out = tmp_path / "out.onnx"
    result = answer("export", _models.write_shape_field(tmp_path / "bunny"), out)
    assert result["inputs"] == {"positions": ["n", 3], "directions": ["n", 3]}
    facts = {entry.key: entry.value for entry in onnx.load(out).metadata_props}
    assert json.loads(facts["box"]) == [[-1.0, -0.5, -0.8], [1.0, 0.5, 0.8]]
    assert json.loads(facts["transform"])["scale"] == 0.02
    assert json.loads(facts["config"])["hidden"] == [24, 16, 16]

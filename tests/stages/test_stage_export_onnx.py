"""The stage that exports the models of a category, and the example of docs/onnx.md on what it wrote."""

import functools
import re
import shutil
import subprocess
import sys

import _models
import pytest
from _experiment_report import ROOT, make

from ddf.core import shipped_models, storage
from ddf.io import onnx_file
from ddf_lab.run import Run


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    root = tmp_path_factory.mktemp("experiment")
    for kind in ("ddf", "ddf_image"):
        _models.write_model(root / f"artifacts/tiny/train_{kind}/chair", kind)
    (root / "configs").mkdir()
    (root / "configs/tiny.yaml").write_text("train: {}\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        few = functools.partial(onnx_file.ExportConfig, ("visibility", "depth", "normals"), (1, 7))
        patch.setattr(onnx_file, "ExportConfig", few)
        make("export_onnx", Run.read("configs/tiny.yaml", "chair"))
    return root / "artifacts/tiny/export_onnx/chair"


def test_every_graph_is_written_with_one_table(written):
    names = {"field", "encoders", "rays", "encode"}
    files = {*(f"{name}.onnx" for name in names), "onnx_parity.csv", "onnx_parity.csv.json"}
    assert {path.name for path in written.iterdir()} == files
    table, record = storage.load_table(written / "onnx_parity.csv")
    assert set(table["graph"]) == names
    assert (table["category"] == "chair").all()
    assert (table["max_abs"] <= table["tolerance"]).all()
    assert (table["bytes"] == [(written / f"{name}.onnx").stat().st_size for name in table["graph"]]).all()
    models = {f"artifacts/tiny/train_{kind}/chair/model.safetensors" for kind in ("ddf", "ddf_image")}
    assert set(record["sources"]) == models


def test_example_of_the_docs_runs_without_this_package(written):
    (example,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/onnx.md").read_text(), re.DOTALL)
    assert len(example.strip().splitlines()) <= 20
    assert set(re.findall(r"(?m)^(?:import|from) (\w+)", example)) == {"numpy", "onnxruntime", "PIL"}
    shutil.copytree(shipped_models.ROOT / "chair", written / "chair_model")
    words = [sys.executable, "-I", "-c", example]
    done = subprocess.run(words, cwd=written, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\d+ of 4096 rays hit", done.stdout)
    assert "box [[-1, -1, -1], [1, 1, 1]]" in done.stdout

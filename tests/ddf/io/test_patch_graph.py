"""Patches as an ONNX file: onnxruntime meets what the compiled walk meets."""

import json
import re

import numpy as np
import onnxruntime
import pytest
from _shapes import cube, joined, torus
from _support import assert_close

from ddf import cli
from ddf.core import checks
from ddf.fields.grid import octree, patch_field
from ddf.fit import patch_fitting
from ddf.io import onnx_field

TOLERANCES = {"visibility": 0.0, "depth": 1e-6, "normals": 1e-6, "mean_curvature": 1e-4, "gaussian_curvature": 1e-3}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("patches")
    shape = joined(torus(), cube(0.2))  # curved and flat, and edges
    patch_fitting.fit(shape, octree.PatchConfig(1e-3), folder)
    assert cli.main(["export", "--json", str(folder), str(folder / "field.onnx")]) == 0
    return folder


def _rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Random ones from in and around the box, a third of them along an axis."""
    random = np.random.default_rng(0)
    ways = random.standard_normal((count, 3))
    ways[::3] = np.eye(3)[random.integers(0, 3, len(ways[::3]))] * random.choice([-1, 1], (len(ways[::3]), 1))
    starts = random.uniform(-1.3, 1.3, (count, 3)).astype(np.float32)
    return starts, (ways / np.linalg.norm(ways, axis=1, keepdims=True)).astype(np.float32)


def test_the_file_meets_what_the_compiled_walk_meets(exported):
    field, (starts, ways) = patch_field.load(exported / "model.safetensors"), _rays(6000)
    expected = field.evaluate(starts, ways, field.outputs)
    again = starts + expected["depth"][:, None] * ways  # from the surface on, the other way too
    session = onnxruntime.InferenceSession(exported / "field.onnx", providers=["CPUExecutionProvider"])
    for begin, along in ((starts, ways), (again.astype(np.float32), ways), (again.astype(np.float32), -ways)):
        expected = field.evaluate(begin, along, field.outputs)
        found = session.run(list(field.outputs), {"positions": begin, "directions": along})
        assert 0.05 < expected["visibility"].mean() < 0.95
        for name, values in zip(field.outputs, found, strict=True):
            assert_close(values, expected[name].astype(np.float32), atol=TOLERANCES[name], rtol=1e-5)


def test_a_file_whose_loop_may_not_end_is_refused(exported, tmp_path):
    data = (exported / "field.onnx").read_bytes()
    name = rb"most_steps"
    (place,) = (match.start() for match in re.finditer(name, data) if data[match.start() - 2 : match.start()] == b"B\n")
    assert onnx_field.load(exported / "field.onnx").outputs == patch_field.OUTPUTS
    (tmp_path / "field.onnx").write_bytes(data[:place] + b"more_steps" + data[place + len(name) :])
    with pytest.raises(checks.InputError, match=r"has a node Loop, as no file of `ddf export` has"):
        onnx_field.load(tmp_path / "field.onnx")


def test_outputs_are_chosen(exported, capsys):
    out = exported / "depth.onnx"
    assert cli.main(["export", "--json", str(exported), str(out), "--outputs", "depth,visibility"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert set(said["parity"]) == {"depth", "visibility"} == set(onnx_field.load(out).outputs)
    assert max(each["max_abs"] for each in said["parity"].values()) < 1e-5

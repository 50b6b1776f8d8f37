"""ONNX files that are no fields: each is refused in one line, before it takes memory or time."""

import os
import subprocess
import sys

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

import ddf
from ddf.core import checks
from ddf.io import onnx_field

FACTS = {"box": "[[-1, -1, -1], [1, 1, 1]]", "transform": "none"}
VALUES = {"visibility": ("Mul", "first", "first"), "depth": ("Abs", "first")}


def _file(tmp_path, extra=(), values=VALUES, facts=FACTS, ir=10):
    """visibility = x², depth = |x| of the first coordinate of the position."""
    nodes = [helper.make_node("Gather", ["positions", "zero"], ["first"], axis=1), *extra]
    nodes += [helper.make_node(kind, given, [name]) for name, (kind, *given) in values.items()]
    rows = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", 3]) for name in ("positions", "directions")]
    outs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, None) for name in values]
    constants = [helper.make_tensor("zero", TensorProto.INT64, [], [0])]
    constants += [helper.make_tensor("nan", TensorProto.FLOAT, [1], [np.nan])]
    constants += [helper.make_tensor("many", TensorProto.INT64, [2], [9000, 90000])]
    constants += [helper.make_tensor("trips", TensorProto.INT64, [], [1 << 40])]
    model = helper.make_model(helper.make_graph(nodes, "g", rows, outs, constants))
    model.ir_version, model.opset_import[0].version = ir, 18
    helper.set_model_props(model, facts)
    path = tmp_path / "field.onnx"
    path.write_bytes(model.SerializeToString())
    return path


def test_a_right_file_answers(tmp_path):
    found = onnx_field.load(_file(tmp_path)).evaluate(np.full((9000, 3), 0.5), np.eye(3)[[0] * 9000], ("depth",))
    np.testing.assert_array_equal(found["depth"], np.full(9000, 0.5, dtype=np.float32))


ENDLESS = [helper.make_node("Loop", ["trips", ""], ["x"], body=helper.make_graph([], "body", [], []))]
BIG = [helper.make_node("ConstantOfShape", ["many"], ["big"])]
BIG += [helper.make_node("ReduceSum", ["big"], ["sum"], keepdims=0)]
REFUSED = {
    "shape": ({"values": VALUES | {"visibility": ("Abs", "positions")}}, r"'visibility' must be float32 of shape \(2,"),
    "kind": ({"values": VALUES | {"depth": ("IsNaN", "first")}}, "not an ONNX file|must be float32"),
    "missing": ({"values": {"visibility": VALUES["visibility"]}}, "gives no depth"),
    "nan": ({"values": VALUES | {"depth": ("Mul", "first", "nan")}}, "gives no depth, or values that are not numbers"),
    "memory": ({"extra": BIG, "values": VALUES | {"depth": ("Mul", "first", "sum")}}, "smaller than requested bytes"),
    "endless": ({"extra": ENDLESS}, "has a node Loop, as no file"),
    "later": ({"ir": 99}, "Unsupported model IR version: 99.*; update onnxruntime"),
    "box": ({"facts": FACTS | {"box": "[[1, 1, 1], [-1, 1, 1]]"}}, "lower must be below upper"),
    "infinite box": ({"facts": FACTS | {"box": "[[-1, -1, -1], [1, Infinity, 1]]"}}, "lower must be below upper"),
    "words": ({"facts": FACTS | {"box": '["a", "b"]'}}, "its record lacks what a field needs"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_field_is_refused_in_one_line(name, tmp_path, capfd):
    changes, reason = REFUSED[name]
    with pytest.raises(checks.InputError, match=reason) as caught:
        onnx_field.load(_file(tmp_path, **changes))
    assert len(str(caught.value)) < 500 and "\n" not in str(caught.value) and "field.onnx" in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_weights_outside_the_file_are_not_followed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = onnx.load(ddf.load("rabbit-network").export(tmp_path / "whole.onnx"))
    onnx.save(model, "field.onnx", save_as_external_data=True, location="weights.bin", size_threshold=0)
    with pytest.raises(checks.InputError, match=r"field\.onnx: not an ONNX file that onnxruntime reads"):
        onnx_field.load(tmp_path / "field.onnx")


def test_nothing_is_written_outside_the_output(tmp_path):
    file, home = ddf.load("rabbit-network").export(tmp_path / "rabbit.onnx"), tmp_path / "home"
    home.mkdir()
    program = f"import ddf; ddf.load('{file}').query([[0.0, 0.45, 5.0]], [[0.0, 0.0, -1.0]])"
    alone = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "ORT_"))}
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60, env={**alone, "HOME": str(home)})
    assert not list(home.rglob("*"))

"""Sines of exported graphs: the polynomials against float64, and that only what may be rewritten is."""

import _models
import numpy as np
import onnx
import onnx.helper
import onnx.numpy_helper
import pytest
import torch
from _support import assert_close

from ddf import fields, onnx_export, onnx_graphs, onnx_parity, onnx_sines

SPAN = 40.0  # angles in radians, either side


def _graph(kinds, reader="Gemm", alpha=1.0):
    """x to sines or cosines of x W + b, then what reads them; W and b as a float64 function too."""
    random = np.random.default_rng(0)
    weights = {
        "w": random.uniform(-1, 1, (8, 1)),
        "b": random.uniform(-3, 3, 8),
        "w2": random.uniform(-1, 1, (4, 8)),
        "b2": random.uniform(-1, 1, 4),
    }
    weights = {name: values.astype(np.float32) for name, values in weights.items()}
    nodes = [onnx.helper.make_node("Gemm", ["x", "w", "b"], ["a"], transB=1, alpha=alpha)]
    outputs = []
    for kind in kinds:
        nodes.append(onnx.helper.make_node(kind, ["a"], [kind]))
        outputs.append(f"y{kind}")
        if reader == "Gemm":
            nodes.append(onnx.helper.make_node("Gemm", [kind, "w2", "b2"], [outputs[-1]], transB=1))
        else:
            nodes.append(onnx.helper.make_node("Abs", [kind], [outputs[-1]]))
    info = onnx.helper.make_tensor_value_info
    width = 4 if reader == "Gemm" else 8
    graph = onnx.helper.make_graph(
        nodes,
        "g",
        [info("x", onnx.TensorProto.FLOAT, ["n", 1])],
        [info(name, onnx.TensorProto.FLOAT, ["n", width]) for name in outputs],
        [onnx.numpy_helper.from_array(values, name) for name, values in weights.items()],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 18)])
    model.ir_version = onnx_export.IR_VERSION
    return model, {name: values.astype(np.float64) for name, values in weights.items()}


def _kinds(model):
    return {node.op_type for node in model.graph.node}


@pytest.mark.parametrize("kinds", [("Sin",), ("Sin", "Cos"), ("Cos",)])
@pytest.mark.parametrize("reader", ["Gemm", "Abs"])
def test_values_are_those_of_float64_over_many_turns(kinds, reader):
    model, weights = _graph(kinds, reader)
    onnx_sines.rewrite(model)
    onnx.checker.check_model(model, full_check=True)
    assert not _kinds(model) & {"Sin", "Cos"}
    x = np.linspace(-SPAN, SPAN, 4001, dtype=np.float32)[:, None]
    found = onnx_parity.session(model.SerializeToString()).run(None, {"x": x})
    angles = x.astype(np.float64) @ weights["w"].T + weights["b"]
    for kind, values in zip(kinds, found, strict=True):
        exact = np.sin(angles) if kind == "Sin" else np.cos(angles)
        expected = exact @ weights["w2"].T + weights["b2"] if reader == "Gemm" else np.abs(exact)
        assert_close(values, expected, atol=SPAN * float(np.finfo(np.float32).eps) * 4, rtol=0.0)


def test_a_sine_that_a_modulation_scales_keeps_its_value():
    field, modulated = _models.field(), fields.ConditionalPDDF(_models.field().config, 5)
    modulated.field.load_state_dict(field.state_dict())
    graph = onnx_graphs.FieldGraph(modulated.field, ("depth",), modulated.modulator, torch.randn(3, 5))
    data = onnx_export.to_onnx(graph, {})
    assert not _kinds(onnx.load_from_string(data)) & {"Sin", "Cos"}
    (row,) = [row for row in onnx_parity.compare(data, "g", graph, (300,), 0) if row.cases != onnx_parity.HARD]
    assert row.max_abs < 1e-5  # a factor left out would be over 1e-2


def test_angles_that_are_scaled_or_read_by_others_stay():
    scaled, _ = _graph(("Sin",), alpha=2.0)
    onnx_sines.rewrite(scaled)
    assert "Sin" in _kinds(scaled)
    shared, _ = _graph(("Sin",))
    shared.graph.node.append(onnx.helper.make_node("Abs", ["a"], ["z"]))
    before = shared.SerializeToString(deterministic=True)
    onnx_sines.rewrite(shared)
    assert shared.SerializeToString(deterministic=True) == before


def test_weights_that_nothing_reads_any_more_are_left_out():
    model, _ = _graph(("Sin",))
    onnx_sines.rewrite(model)
    used = {name for node in model.graph.node for name in node.input}
    assert {tensor.name for tensor in model.graph.initializer} <= used
    assert "w" not in used

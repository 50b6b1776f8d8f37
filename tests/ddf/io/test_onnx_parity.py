"""How far onnxruntime is from torch: measured on hard rays too, and refused beyond its tolerance."""

import dataclasses

import _models
import onnx
import pytest
import torch

from ddf.fields import field_outputs
from ddf.io import onnx_file, onnx_graphs, onnx_parity

ALL = tuple(field_outputs.OUTPUTS)


def _row(**values):
    row = onnx_parity.Row("field", 1, "random 7", 100, "depth", 1e-6, 1e-7, 1e-5, 0)
    return dataclasses.replace(row, **values)


@torch.no_grad()
def test_hard_rays_graze_switch_saturate_and_start_on_the_surface():
    graph = onnx_graphs.FieldGraph(_models.field("relu"), ALL)
    hard = onnx_parity.hard_inputs(graph, torch.Generator().manual_seed(0))
    common = onnx_parity.example_inputs(graph, 1000, torch.Generator().manual_seed(1))
    found, usual = graph.values(hard), graph.values(common)
    cosine = (found.normals * found.directions).sum(-1).abs()
    first, each = len(onnx_parity.box_rays()[0]), onnx_parity.HARD_OF_EACH
    assert cosine[first : first + each].max() < 0.05
    assert found.raw[first + each : first + 2 * each, 2].abs().max() < 0.05
    assert found.raw[:, 3].max() >= usual.raw[:, 3].max() - 0.05
    assert found.raw[:, 3].min() <= usual.raw[:, 3].min() + 0.05
    assert found.positions.abs().max() == 1
    tail = hard["positions"][-2 * each :]
    assert torch.equal(tail[:each], tail[each:])
    assert torch.equal(hard["directions"][-1], -hard["directions"][-1 - each])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"max_abs": 2e-5}, "field: onnxruntime and torch must agree on depth within 1e-05; got 2e-05 on random 7"),
        ({"max_abs": float("nan")}, "must agree on depth"),
        ({"unclear": 6}, "depth must be continuous at 95% of random rays at least; 6 of 100 are not"),
    ],
)
def test_rows_outside_their_tolerance_are_refused(values, message):
    onnx_parity.require([_row(), _row(cases="hard", unclear=90), _row(unclear=5)])
    with pytest.raises(onnx_parity.ParityError, match=message):
        onnx_parity.require([_row(), _row(**values)])


def test_values_that_are_not_finite_and_files_that_do_not_load_are_refused():
    graph = onnx_graphs.FieldGraph(_models.field(), ("depth",))
    model = onnx.load_from_string(onnx_file.to_onnx(graph, {}))
    for tensor in model.graph.initializer:
        if len(tensor.raw_data) == 4 * 16 * 24:
            tensor.raw_data = b"\xff" * len(tensor.raw_data)  # NaN
    with pytest.raises(onnx_parity.ParityError, match="depth must be finite, of shape"):
        onnx_parity.compare(model.SerializeToString(), "field", graph, (7,))
    with pytest.raises(onnx_parity.ParityError, match="field: onnxruntime cannot load the file"):
        onnx_parity.compare(b"nonsense", "field", graph, (7,))
    with pytest.raises(onnx_parity.ParityError, match="field: onnxruntime cannot run random 7"):
        other = onnx_graphs.FieldGraph(_models.field(), ("visibility",))
        onnx_parity.compare(onnx_file.to_onnx(other, {}), "field", graph, (7,))

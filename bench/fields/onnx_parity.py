"""onnxruntime against torch: every output of every graph of the shipped car's model, and what smaller weights cost.

What the stage `export_onnx` does, and nothing is kept: float32 is held
to the tolerance of each output, random inputs at every length and the hard cases apart. A row has the largest figures
of its inputs.
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.lib import measuring
from ddf.core import shipped_models
from ddf.io import exportable, onnx_file, onnx_parity, weight_precision

MODEL, THREADS = "car", 1
FIGURES = ("max_abs", "mean_abs", "q999_abs", "max_relative", "torch_error", "onnx_error")
TOGETHER = ("image_field",)  # graphs of others: their smaller weights cost what those of the parts do


def compared() -> list[onnx_parity.Row]:
    """All rows of the model's graphs; a float32 file outside its tolerance ends it."""
    section = onnx_file.ExportConfig(precisions=weight_precision.PRECISIONS[1:])
    rows: list[onnx_parity.Row] = []
    graphs, source = exportable.load(shipped_models.place(MODEL), section.outputs)
    with tempfile.TemporaryDirectory() as folder:
        for name, graph in graphs.items():
            out = Path(folder) / f"{name}.onnx"
            rows += onnx_file.export(graph, name, out, source, section)
            if name not in TOGETHER:
                rows += onnx_file.measure_precisions(graph, name, out.read_bytes(), section)
    return rows


def together(rows: Sequence[onnx_parity.Row]) -> list[dict[str, Any]]:
    """A line for each graph, precision, output and kind of inputs, in the order of the rows."""
    groups: dict[tuple[str, str, str, bool], list[onnx_parity.Row]] = {}
    for row in rows:
        groups.setdefault((row.graph, row.precision, row.output, row.cases == onnx_parity.HARD), []).append(row)
    lines = []
    for (graph, precision, output, hard), members in groups.items():
        size = {"precision": precision, "output": output, "inputs": "hard cases" if hard else "random"}
        size |= {"rows": [row.rows for row in members]}
        error = {name: max(getattr(row, name) for row in members) for name in FIGURES}
        held = members[0].tolerance if precision == "float32" else None
        told = {"tolerance": held, "unclear": sum(row.unclear for row in members), "bytes": members[0].bytes}
        lines.append({"what": graph, "size": size, "error": error, **told})
    return lines


def main() -> None:
    """Compare and write."""
    measuring.write("onnx_parity", THREADS, together(compared()))

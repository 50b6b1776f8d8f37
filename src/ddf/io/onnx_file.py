"""A trained model as ONNX files: written only after onnxruntime gave what torch gives, and saying what they are.

The graph is recorded by torch's TorchScript exporter from the very functions that the package runs, so a new output
needs no second definition. Against its successor (`dynamo=True`), on a field of six layers: some thirty times faster,
no further packages (onnxscript, onnx-ir), and no paths of the machine inside the file. It is deprecated, which is why
its warning is silenced here, and it is called in this one place; every file is compared with the model whoever made
it. Building the graph by hand would need a second definition of every network and of every derivative pass.
"""

import itertools
import json
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import onnx
import torch

from ddf.core import checks, extras, storage
from ddf.fields import field_outputs
from ddf.io import onnx_parity, onnx_reductions, patch_graph, weight_precision
from ddf.io.onnx_graphs import DYNAMIC, Graph

OPSET = 18
IR_VERSION = 10  # onnxruntime 1.18 and later read it
LICENCE = "MIT"
MEASURED_POINTS, MEASURED_IMAGES = 4096, 16  # rows on which smaller weights are compared


@dataclass(frozen=True)
class ExportConfig:
    """What is exported, and how it is compared.

    outputs: of the fields, among `field_outputs.OUTPUTS`. batches: numbers of oriented points that are compared; of
    images at most 64. precisions: of the weights, measured beside float32 and never written.
    """

    outputs: tuple[str, ...] = ("visibility", "depth", "normals", "weight_1", "mean_curvature", "gaussian_curvature")
    batches: tuple[int, ...] = (1, 7, 4096)
    precisions: tuple[str, ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        field_outputs.require(self.outputs)
        if not self.batches or min(self.batches) < 1:
            raise checks.InputError(f"batches must be >= 1; got {self.batches}")
        for precision in self.precisions:
            weight_precision.require(precision)


def export(
    graph: Graph,
    name: str,
    out: Path,
    source: Mapping[str, Any],
    config: ExportConfig,
    precision: str = "float32",
) -> list[onnx_parity.Row]:
    """Write one graph to `out` and return how it compares with torch.

    Args:
      name: of the graph, for messages and tables. source: what `describe_source` says of the model.
      precision: of the weights; below float32 the differences are returned but held to no tolerance.
    Raises:
      ParityError: outside the tolerance; there is no file then, and an earlier one is left as it was.
    """
    data = to_onnx(graph, source)
    if precision != weight_precision.FULL:
        data = weight_precision.reduce(data, precision)
    rows = onnx_parity.compare(data, name, graph, config.batches, config.seed, precision)
    if precision == weight_precision.FULL:
        onnx_parity.require(rows)
    storage.write_bytes(out, data)
    return rows


def measure_precisions(graph: Graph, name: str, data: bytes, config: ExportConfig) -> list[onnx_parity.Row]:
    """What smaller weights would cost: sizes and errors of `config.precisions`; nothing is written."""
    rows = []
    count = MEASURED_POINTS if graph.largest_batch is None else MEASURED_IMAGES
    for precision in config.precisions:
        reduced = weight_precision.reduce(data, precision)
        rows += onnx_parity.compare(reduced, name, graph, (count,), config.seed, precision)
    return rows


def to_onnx(graph: Graph, source: Mapping[str, Any]) -> bytes:
    """The graph as an ONNX file: named inputs and outputs, free first axis, what it is in its metadata."""
    examples = onnx_parity.example_inputs(graph.eval(), 2, torch.Generator().manual_seed(0))
    free = [name for name, shape in graph.inputs.items() if shape[0] == DYNAMIC]
    with torch.no_grad():
        shapes = {key: list(value.shape) for key, value in zip(graph.meanings, graph(*examples.values()), strict=True)}
    axes = {name: {0: DYNAMIC} for name in [*free, *(key for key in shapes if _is_free(graph, key))]}
    if isinstance(graph, patch_graph.PatchGraph):
        model = graph.assemble(lambda part, ins, given, outs: _recorded(part, ins, given, outs, _all_free(ins, outs)))
    else:
        model = _recorded(graph, list(graph.inputs), tuple(examples.values()), list(graph.meanings), axes)
    for value in model.graph.output:
        lengths = [DYNAMIC if i == 0 and value.name in axes else n for i, n in enumerate(shapes[value.name])]
        value.CopyFrom(onnx.helper.make_tensor_value_info(value.name, onnx.TensorProto.FLOAT, lengths))
    _describe(model, graph, source)
    onnx.checker.check_model(model, full_check=True)
    return model.SerializeToString(deterministic=True)


def _recorded(
    part: torch.nn.Module,
    inputs: Sequence[str],
    given: Sequence[torch.Tensor],
    outputs: Sequence[str],
    axes: dict[str, dict[int, str]],
) -> onnx.ModelProto:
    """What a module does to its inputs."""
    with tempfile.TemporaryDirectory() as folder, torch.no_grad(), warnings.catch_warnings():
        path = Path(folder) / "graph.onnx"
        warnings.simplefilter("ignore")  # that it is deprecated, and shape checks in tests; parity has the last word
        torch.onnx.export(
            part,
            tuple(given),
            path,
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes=axes,
            opset_version=OPSET,
            dynamo=False,
        )
        model = onnx.load(path)
    onnx_reductions.count_axes_from_the_front(model)
    return model


def _all_free(*names: Sequence[str]) -> dict[str, dict[int, str]]:
    """First axes of any length, each its own."""
    return {name: {0: f"{name}_rows"} for name in itertools.chain(*names)}


def _is_free(graph: Graph, output: str) -> bool:
    """Whether an output has one row per row of the free axis; the camera of a single image has not."""
    return not (output == "camera" and "image" in graph.inputs)


def _describe(model: onnx.ModelProto, graph: Graph, source: Mapping[str, Any]) -> None:
    for node in model.graph.node:
        node.doc_string = ""
    model.ir_version = IR_VERSION
    model.producer_name, model.producer_version, model.doc_string = "ddf", extras.version(), graph.what
    facts: dict[str, Any] = {
        "what": graph.what,
        "inputs": {name: list(shape) for name, shape in graph.inputs.items()},
        "outputs": graph.meanings,
        "frame": "field frame: the shape's box is centred at 0 and its longest side is 2; directions have length 1",
        "box": [[-1, -1, -1], [1, 1, 1]],
        "images": "RGBA in [0, 1], rows from the top, transparent pixels black, the object filling a square image",
        "precision": weight_precision.FULL,
        "ddf_version": extras.version(),
        "model_license": LICENCE,
        **source,
    }
    if "images" not in graph.inputs and "image" not in graph.inputs:
        del facts["images"]
    texts = {
        key: value if isinstance(value, str) else json.dumps(value, sort_keys=True) for key, value in facts.items()
    }
    onnx.helper.set_model_props(model, texts)


def describe_source(model_file: Path, record: Mapping[str, Any]) -> dict[str, Any]:
    """Which file a graph comes from: its last two names, SHA-256, the sizes in its record, its box and transform."""
    train, section = record.get("train", {}), record.get("section", record)
    sizes = {key: train[key] for key in ("image_size", "encoder_width", "latent_features") if key in train}
    layers = {**train.get("decoder", {}), **section.get("field", {})}
    sizes |= {key: layers[key] for key in LAYER_KEYS if key in layers}
    box = {"box": [record["box"][side] for side in ("lower", "upper")]} if "box" in record else {}
    return box | {
        "source": "/".join(model_file.absolute().parts[-2:]),
        "source_sha256": storage.checksum(model_file),
        "config": {"kind": record.get("kind"), **sizes},
        "transform": record.get("field_from_mesh", "none: inputs and outputs are in the field frame"),
    }


LAYER_KEYS = ("hidden", "omega_first", "omega_hidden", "depth_activation", "depth_sharpness")


def figures(rows: Sequence[onnx_parity.Row]) -> dict[str, dict[str, float]]:
    """Per output the worst figures over all inputs, for `ddf export`."""
    worst: dict[str, dict[str, float]] = {}
    for row in rows:
        entry = worst.setdefault(row.output, {"max_abs": 0.0, "mean_abs": 0.0, "max_relative": 0.0, "unclear": 0})
        for key, value in entry.items():
            entry[key] = max(value, getattr(row, key))
        entry["tolerance"] = row.tolerance
    return worst

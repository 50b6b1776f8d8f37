"""A trained model as ONNX files: written only after onnxruntime gave what torch gives, and saying what they are.

The graph is recorded by torch's TorchScript exporter from the very functions that the package runs, so a new output
needs no second definition. Against its successor (`dynamo=True`), on a field of six layers: some thirty times faster,
no further packages (onnxscript, onnx-ir), and no paths of the machine inside the file. It is deprecated, which is why
its warning is silenced here, and it is called in this one place; every file is compared with the model whoever made
it. Building the graph by hand would need a second definition of every network and of every derivative pass.

onnxruntime 1.31 does not count negative axes from the back where an input is empty: the sum of an array of shape (0, 3)
over axis -1 has shape (0, 3) there instead of (0), and the next node fails. Axes from 0 on are right for any length.
"""

import json
import tempfile
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnx.helper
import onnx.numpy_helper
import torch

from ddf.core import checks, extras, storage
from ddf.fields import field_file, model_files, shape_field
from ddf.fields.grid import patch_field
from ddf.io import onnx_graphs, onnx_parity, patch_graph
from ddf.io.onnx_graphs import DYNAMIC, Graph
from ddf.models import line_field, reconstruction_models

OPSET = 18
IR_VERSION = 10  # onnxruntime 1.18 and later read it
LICENCE = "MIT"


def count_axes_from_the_front(model: onnx.ModelProto) -> None:
    """Write the negative axes of all reductions as axes from 0 on, in place; the values stay the same, bit for bit.
    ValueError where they are no constant, or a rank is unknown.
    """
    graph = onnx.shape_inference.infer_shapes(model).graph
    known = [*graph.value_info, *graph.input, *graph.output]
    ranks = {value.name: len(value.type.tensor_type.shape.dim) for value in known}
    constants = {tensor.name: onnx.numpy_helper.to_array(tensor) for tensor in model.graph.initializer}
    for node in model.graph.node:
        if node.op_type == "Constant":
            constants[node.output[0]] = onnx.numpy_helper.to_array(node.attribute[0].t)
    written = set()
    for node in model.graph.node:
        if not node.op_type.startswith("Reduce") or len(node.input) < 2:
            continue
        if node.input[1] not in constants or node.input[0] not in ranks:
            raise ValueError(f"{node.name}: the axes and the rank of a reduction must be known")
        axes = np.atleast_1d(constants[node.input[1]]) % ranks[node.input[0]]
        node.input[1] = "axes_" + "_".join(map(str, axes))
        if node.input[1] not in written:
            model.graph.initializer.append(onnx.numpy_helper.from_array(axes, node.input[1]))
            written.add(node.input[1])
    _drop_unread(model.graph)


def _drop_unread(graph: onnx.GraphProto) -> None:
    """Take out the constants that nothing reads any more."""
    read = {name for node in graph.node for name in node.input}
    for node in [node for node in graph.node if node.op_type == "Constant" and node.output[0] not in read]:
        graph.node.remove(node)
    for tensor in [tensor for tensor in graph.initializer if tensor.name not in read]:
        graph.initializer.remove(tensor)


@dataclass(frozen=True)
class ExportConfig:
    """What is exported, and how it is compared.

    outputs: of the fields, among `field_outputs.OUTPUTS`. batches: numbers of oriented points that are compared; of
    images at most 64.
    """

    outputs: tuple[str, ...] = ("visibility", "depth", "normals", "weight_1", "mean_curvature", "gaussian_curvature")
    batches: tuple[int, ...] = (1, 7, 4096)


def export(
    graph: Graph, name: str, out: Path, source: Mapping[str, Any], config: ExportConfig
) -> list[onnx_parity.Row]:
    """Write one graph to `out` and return how it compares with torch.

    Args:
      name: of the graph, for messages and tables. source: what `describe_source` says of the model.
    Raises:
      ParityError: as `onnx_parity.compare`; there is no file then, and an earlier one is left as it was.
    """
    data = to_onnx(graph, source)
    rows = onnx_parity.compare(data, name, graph, config.batches)
    storage.write_bytes(out, data)
    return rows


def to_onnx(graph: Graph, source: Mapping[str, Any]) -> bytes:
    """The graph as an ONNX file: named inputs and outputs, free first axis, what it is in its metadata."""
    examples = onnx_parity.example_inputs(graph.eval(), 2, torch.Generator().manual_seed(0))
    free = [name for name, shape in graph.inputs.items() if shape[0] == DYNAMIC]
    with torch.no_grad():
        shapes = [value.shape for value in graph(*examples.values())]
    axes = {name: {0: DYNAMIC} for name in (*free, *graph.meanings)}
    if isinstance(graph, patch_graph.PatchGraph):
        model = graph.assemble(  # first axes of any length, each its own
            lambda part, ins, given, outs: _recorded(
                part, ins, given, outs, {name: {0: f"{name}_rows"} for name in (*ins, *outs)}
            )
        )
    else:
        model = _recorded(graph, list(graph.inputs), tuple(examples.values()), list(graph.meanings), axes)
    for value, shape in zip(model.graph.output, shapes, strict=True):
        lengths = [DYNAMIC, *shape[1:]]
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
    count_axes_from_the_front(model)
    return model


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
        "images": "square RGBA in [0, 1], rows from the top, transparent is black; the object's diagonal is 0.7 sides",
        "ddf_version": extras.version(),
        "model_license": LICENCE,
        **source,
    }
    if not {"images", "image"} & set(graph.inputs):
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
        entry = worst.setdefault(row.output, {"max_abs": 0.0, "mean_abs": 0.0, "tolerance": 0.0, "unclear": 0})
        worst[row.output] = {key: max(value, getattr(row, key)) for key, value in entry.items()}
    return worst


def load_graphs(folder: Path, outputs: tuple[str, ...] | None) -> tuple[dict[str, Graph], dict[str, Any]]:
    """The graphs of a model by name, the plainest first, and the facts about their source for the files.
    Outputs are of fields, None for all.
    """
    path = folder / model_files.MODEL
    record = storage.load_metadata(path)
    kind, graphs = record.get("kind"), dict[str, Graph]()
    if kind == field_file.PATCHES:
        graphs["field"] = patch_graph.PatchGraph(patch_field.load(path), outputs)
    elif kind == field_file.KIND:
        graphs["field"] = onnx_graphs.FieldGraph(shape_field.load(folder).field.cpu(), outputs)
    elif kind == "ddf":
        ddf, image_size, _ = reconstruction_models.load_ddf(folder)
        graphs |= onnx_graphs.ddf_graphs(ddf.cpu(), image_size, outputs)
    elif kind == line_field.KIND:
        trained = line_field.load(folder)
        graphs |= onnx_graphs.line_graphs(trained.network.cpu(), trained.image_size)
    else:
        raise checks.InputError(f"{folder}: holds no DDF; give a folder that `make train` or `ddf fit` wrote")
    return graphs, describe_source(path, record)

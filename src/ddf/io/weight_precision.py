"""Smaller weights for an ONNX file: what they save and what they cost is measured, never assumed.

float16, bfloat16: weights are stored so and cast to float32 when a session loads them; a file of half the size, the
same speed. int8: onnxruntime's dynamic quantisation of the matrix products (weights per tensor, activations per call);
convolutions stay as they are, so the encoders hardly shrink.
"""

import logging
import tempfile
from pathlib import Path

import numpy as np
import onnx
import onnx.helper
import onnx.numpy_helper

from ddf.core import checks

FULL = "float32"
STORED = {"float16": onnx.TensorProto.FLOAT16, "bfloat16": onnx.TensorProto.BFLOAT16}
PRECISIONS = (*STORED, "int8")
SMALLEST = 64  # values: shorter constants are not worth a cast


def require(precision: str) -> None:
    """Raise InputError unless it is one of `PRECISIONS`."""
    if precision not in PRECISIONS:
        raise checks.InputError(f"precision must be one of {', '.join(PRECISIONS)}; got {precision!r}")


def reduce(data: bytes, precision: str) -> bytes:
    """The file with its weights in the precision named, which its metadata then says."""
    require(precision)
    model = onnx.load_from_string(data)
    if any(node.op_type == "Loop" for node in model.graph.node):
        raise checks.InputError(f"{precision} is of networks; patches are integers of 16 bits already")
    properties = {entry.key: entry.value for entry in model.metadata_props}
    model = _stored(model, precision) if precision in STORED else _quantised(model)
    onnx.helper.set_model_props(model, properties | {"precision": precision})
    onnx.checker.check_model(model)
    return model.SerializeToString(deterministic=True)


def _stored(model: onnx.ModelProto, precision: str) -> onnx.ModelProto:
    casts = []
    for index, tensor in enumerate(model.graph.initializer):
        if tensor.data_type != onnx.TensorProto.FLOAT or int(np.prod(tensor.dims)) < SMALLEST:
            continue
        name, stored = tensor.name, f"{tensor.name}.{precision}"
        values = onnx.numpy_helper.to_array(tensor)
        kind = onnx.helper.tensor_dtype_to_np_dtype(STORED[precision])
        model.graph.initializer[index].CopyFrom(onnx.numpy_helper.from_array(values.astype(kind), stored))
        casts.append(onnx.helper.make_node("Cast", [stored], [name], to=onnx.TensorProto.FLOAT, name=f"{name}.cast"))
    nodes = list(model.graph.node)
    del model.graph.node[:]
    model.graph.node.extend([*casts, *nodes])
    return model


def _quantised(model: onnx.ModelProto) -> onnx.ModelProto:
    from onnxruntime import quantization  # slow to import, and only needed here

    logger = logging.getLogger()
    level = logger.level
    logger.setLevel(logging.ERROR)  # it advises a preparation that changes nothing for these graphs
    try:
        with tempfile.TemporaryDirectory() as folder:
            source, target = Path(folder) / "float32.onnx", Path(folder) / "int8.onnx"
            onnx.save(_unshared(model), source)
            quantization.quantize_dynamic(
                source, target, op_types_to_quantize=["MatMul", "Gemm"], weight_type=quantization.QuantType.QInt8
            )
            return onnx.load(target)
    finally:
        logger.setLevel(level)


def _unshared(model: onnx.ModelProto) -> onnx.ModelProto:
    """Every matrix product with weights of its own.

    The quantiser transposes a Gemm's weights in place, which breaks the derivative passes: they read the same weights
    the other way round. The copies cost a byte per weight.
    """
    tensors = {tensor.name: tensor for tensor in model.graph.initializer}
    for index, node in enumerate(model.graph.node):
        if node.op_type == "Gemm" and node.input[1] in tensors:
            copied = onnx.TensorProto()
            copied.CopyFrom(tensors[node.input[1]])
            copied.name = f"{copied.name}.{index}"
            model.graph.initializer.append(copied)
            node.input[1] = copied.name
    used = {name for node in model.graph.node for name in node.input}
    kept = [tensor for tensor in model.graph.initializer if tensor.name in used]
    del model.graph.initializer[:]
    model.graph.initializer.extend(kept)
    return model

"""Smaller weights for an ONNX file: stored in float16 or bfloat16, and cast to float32 when a session loads them.

The file has half the size, the same speed; what that costs is measured, never assumed.
"""

import numpy as np
import onnx
import onnx.helper
import onnx.numpy_helper

from ddf.core import checks

FULL = "float32"
STORED = {"float16": onnx.TensorProto.FLOAT16, "bfloat16": onnx.TensorProto.BFLOAT16}
PRECISIONS = tuple(STORED)
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
    model = _stored(model, precision)
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

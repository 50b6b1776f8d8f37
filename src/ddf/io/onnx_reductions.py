"""Reductions of an ONNX graph as onnxruntime needs them for inputs without rows.

onnxruntime 1.31 does not count negative axes from the back where an input is empty: the sum of an array of shape (0, 3)
over axis -1 has shape (0, 3) there instead of (0), and the next node fails. Axes from 0 on are right for any length.
"""

import numpy as np
import onnx


def count_axes_from_the_front(model: onnx.ModelProto) -> None:
    """Write the negative axes of all reductions as axes from 0 on, in place; the values stay the same, bit for bit.

    Raises:
      ValueError: the axes of a reduction are no constant, or its rank is unknown.
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

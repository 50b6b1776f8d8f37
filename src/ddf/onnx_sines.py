"""Sines of an exported graph as polynomials: onnxruntime's own sine takes as long as the matrix product beside it.

Its float32 sine gives about 0.5 elements a nanosecond on one core where its sums and products give 10, so a polynomial
of plain operators is faster. The angles come in turns, u = a/2π, by scaled copies of the weights that make them, and
t = u - round(u) is at most 1/2. Derived here; coefficients are Chebyshev interpolants, computed when a file is made:

  sine alone    u is shifted by 1/4 turn, so sin a = cos 2πt = sin 2πz with z = 1/4 - |t|; an odd polynomial of degree 9
  both          s = sin πt (odd, degree 9) and c = cos πt (even, degree 8); sin a = 2sc and cos a = 1 - 2s²

The largest errors of the polynomials in exact arithmetic are 7e-9 and 1e-7, against 6e-8 of a float32 at 1. Where all
that reads a sine is linear, the leading coefficient goes into the weights that follow. Only angles that come straight
from a matrix product with constant weights, in layers of 256 or less, are rewritten; everything else stays as it is.
"""

import math
from collections.abc import Sequence

import numpy as np
import onnx
import onnx.helper
import onnx.numpy_helper

_QUARTER = 0.25  # of a turn
_WIDEST = 256  # layers: beyond, the product takes so much longer than its sines that nothing is won


def rewrite(model: onnx.ModelProto) -> None:
    """Replace the sines and cosines of `model` where that is possible (module docstring), in place."""
    _Rewriter(model.graph).run()


def _coefficients(function: np.ufunc, turns: float, reach: float, odd: bool) -> list[float]:
    """c_0 ... c_4 of Σ c_k s^k with s = x², times x if `odd`, for function(2π turns x) on |x| <= reach."""
    nodes = np.sqrt(reach**2 * (1 + np.cos(np.pi * (np.arange(5) + 0.5) / 5)) / 2)
    values = function(2 * np.pi * turns * nodes) / (nodes if odd else 1.0)
    return np.linalg.solve(np.vander(nodes**2, increasing=True), values).tolist()


class _Rewriter:
    """One pass over a graph, which is in topological order and stays so."""

    def __init__(self, graph: onnx.GraphProto) -> None:
        self.graph = graph
        self.constants = {tensor.name: tensor for tensor in graph.initializer}
        self.readers: dict[str, list[onnx.NodeProto]] = {value.name: [onnx.NodeProto()] for value in graph.output}
        for node in graph.node:
            for name in node.input:
                self.readers.setdefault(name, []).append(node)
        self.nodes: list[onnx.NodeProto] = []
        self.gains: dict[str, float] = {}  # by a product's output: what its weights are multiplied by
        self.sums: dict[str, tuple[str, str]] = {}  # by angles: (t, s) or (z, s), made where they are first read

    def run(self) -> None:
        """Rewrite, then leave out constants that nothing reads any more."""
        nodes = list(self.graph.node)
        angles = {node.output[0]: self._kinds(node) for node in nodes if self._gives_angles(node)}
        alone = {name for name, kinds in angles.items() if kinds == {"Sin"}}
        for node in nodes:
            if node.op_type == "Sin" and node.input[0] in alone:
                products = self._products(node.output[0])
                for product in products or []:
                    self.gains[product.output[0]] = _ALONE[-1]
        for node in nodes:
            if node.op_type == "Gemm" and (node.output[0] in angles or node.output[0] in self.gains):
                self._scaled_product(node, node.output[0] in angles, node.output[0] in alone)
            elif node.op_type in ("Sin", "Cos") and node.input[0] in alone:
                self._sine_alone(node)
            elif node.op_type in ("Sin", "Cos") and node.input[0] in angles:
                self._sine_or_cosine(node)
            else:
                self.nodes.append(node)
        del self.graph.node[:]
        self.graph.node.extend(self.nodes)
        used = {name for node in self.nodes for name in node.input}
        kept = [tensor for name, tensor in self.constants.items() if name in used]
        del self.graph.initializer[:]
        self.graph.initializer.extend(kept)

    def _kinds(self, node: onnx.NodeProto) -> set[str]:
        return {reader.op_type for reader in self.readers.get(node.output[0], [])}

    def _is_product(self, node: onnx.NodeProto) -> bool:
        """Whether it is x W + b with constant W and b."""
        plain = node.op_type == "Gemm" and not {"alpha", "beta", "transA"} & {item.name for item in _set(node)}
        return plain and len(node.input) == 3 and all(name in self.constants for name in node.input[1:])

    def _gives_angles(self, node: onnx.NodeProto) -> bool:
        kinds = self._kinds(node) if self._is_product(node) else set()
        return bool(kinds) and kinds <= {"Sin", "Cos"} and self.constants[node.input[2]].dims[0] <= _WIDEST

    def _products(self, name: str) -> list[onnx.NodeProto] | None:
        """The products that read a tensor, itself or scaled by a modulation; None if anything else does."""
        found = []
        for node in self.readers.get(name, []):
            if self._is_product(node) and node.input[0] == name:
                found.append(node)
            elif node.op_type == "Mul" and list(node.input).count(name) == 1:
                further = self._products(node.output[0])
                if further is None:
                    return None
                found += further
            else:
                return None
        return found

    def _constant(self, values: np.ndarray | float, name: str) -> str:
        if name not in self.constants:
            self.constants[name] = onnx.numpy_helper.from_array(np.asarray(values, dtype=np.float32), name)
        return name

    def _scaled(self, name: str, factor: float, shift: float = 0.0) -> str:
        """A copy of a constant, scaled and shifted in float64; the same one for the same numbers."""
        if factor == 1.0 and shift == 0.0:
            return name
        values = onnx.numpy_helper.to_array(self.constants[name]).astype(np.float64)
        return self._constant(factor * values + shift, f"{name}.{factor:.9g}.{shift:g}")

    def _scaled_product(self, node: onnx.NodeProto, is_angles: bool, shifted: bool) -> None:
        turns = 1 / (2 * math.pi) if is_angles else 1.0
        weights = self._scaled(node.input[1], turns * self.gains.get(node.output[0], 1.0))
        bias = self._scaled(node.input[2], turns, -_QUARTER if shifted else 0.0)
        changed = onnx.NodeProto()
        changed.CopyFrom(node)
        changed.input[1], changed.input[2] = weights, bias
        self.nodes.append(changed)

    def _add(self, kind: str, *inputs: str | float, to: str | None = None) -> str:
        """One elementwise node; numbers become constants."""
        names = [item if isinstance(item, str) else self._constant(item, f"sines.{item:.9g}") for item in inputs]
        output = to or f"{names[0]}.{len(self.nodes)}"
        self.nodes.append(onnx.helper.make_node(kind, names, [output], name=f"{output}.{kind.lower()}"))
        return output

    def _monic(self, square: str, coefficients: Sequence[float]) -> str:
        """Σ c_k s^k over its leading coefficient, by Horner's rule."""
        *lower, leading = coefficients
        value = square
        for index, coefficient in enumerate(reversed(lower)):
            value = self._add("Mul", value, square) if index else value
            value = self._add("Add", value, coefficient / leading)
        return value

    def _rest(self, angles: str) -> str:
        return self._add("Sub", angles, self._add("Round", angles))

    def _sine_alone(self, node: onnx.NodeProto) -> None:
        if node.input[0] not in self.sums:
            z = self._add("Sub", _QUARTER, self._add("Abs", self._rest(node.input[0])))
            self.sums[node.input[0]] = z, self._add("Mul", z, z)
        z, square = self.sums[node.input[0]]
        value = self._monic(square, _ALONE)
        if self._products(node.output[0]):
            self._add("Mul", value, z, to=node.output[0])
        else:
            self._add("Mul", self._add("Mul", value, z), _ALONE[-1], to=node.output[0])

    def _sine_or_cosine(self, node: onnx.NodeProto) -> None:
        if node.input[0] not in self.sums:
            t = self._rest(node.input[0])
            square = self._add("Mul", t, t)
            self.sums[node.input[0]] = square, self._add("Mul", self._monic(square, _HALF_SINE), t)
        square, sine = self.sums[node.input[0]]
        if node.op_type == "Cos":
            tilted = self._add("Mul", self._add("Mul", sine, sine), -2 * _HALF_SINE[-1] ** 2)
            self._add("Add", tilted, 1.0, to=node.output[0])
        else:
            both = self._add("Mul", sine, self._monic(square, _HALF_COSINE))
            self._add("Mul", both, 2 * _HALF_SINE[-1] * _HALF_COSINE[-1], to=node.output[0])


def _set(node: onnx.NodeProto) -> list[onnx.AttributeProto]:
    """Attributes of a product that are not what they are by default."""
    usual = {"alpha": 1.0, "beta": 1.0, "transA": 0}
    return [item for item in node.attribute if onnx.helper.get_attribute_value(item) != usual.get(item.name)]


_ALONE = _coefficients(np.sin, 1.0, 0.25, odd=True)
_HALF_SINE = _coefficients(np.sin, 0.5, 0.5, odd=True)
_HALF_COSINE = _coefficients(np.cos, 0.5, 0.5, odd=False)

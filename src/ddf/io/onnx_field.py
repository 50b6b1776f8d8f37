"""A field of one shape from its ONNX file, evaluated by onnxruntime: needs neither torch nor the file it came from."""

import json
import os
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry import transforms

SUFFIX = ".onnx"
_FIRST_WEIGHT = "weight_1"  # of the output `weights` of the file


@dataclass(frozen=True)
class OnnxField:
    """A session, and what the file says of its box (field frame) and of the map to its frame: a `FramedField`."""

    session: onnxruntime.InferenceSession
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    field_from_mesh: transforms.Similarity

    @property
    def outputs(self) -> tuple[str, ...]:
        """Those of the file; `weights` goes by the name of its first column."""
        names = (output.name for output in self.session.get_outputs())
        return tuple(_FIRST_WEIGHT if name == "weights" else name for name in names)

    @property
    def scalar(self) -> Float[np.ndarray, ""]:
        """Cameras are computed by numpy."""
        return np.zeros(())

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs inside the box, field frame, float32."""
        if len(positions) == 0:  # files of earlier versions need a row
            one_row = self.evaluate(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), outputs)
            return {name: values[:0] for name, values in one_row.items()}
        asked = [name for name in self.outputs if name in outputs]
        stored = ["weights" if name == _FIRST_WEIGHT else name for name in asked]
        inputs = {"positions": positions.astype(np.float32), "directions": directions.astype(np.float32)}
        found = dict(zip(asked, map(np.asarray, self.session.run(stored, inputs)), strict=True))
        if _FIRST_WEIGHT in found:
            found[_FIRST_WEIGHT] = found[_FIRST_WEIGHT][:, 0]
        return found


def load(path: Path) -> OnnxField:
    """The field of an ONNX file that `ddf export` wrote of what `ddf fit` wrote.

    Raises:
      FileNotFoundError: there is no such file. InputError: it is damaged, or holds something else; it is named.
    """
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file; give an ONNX file that `ddf export` wrote")
    checks.require_content(path)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = _usable_cores()  # named, so that onnxruntime pins none of them
    options.log_severity_level = 3
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has a class of its own per fault, none of them public
        raise checks.InputError(f"{path}: not an ONNX file that onnxruntime reads: {_line(error)}") from error
    inputs = [value.name for value in session.get_inputs()]
    facts = session.get_modelmeta().custom_metadata_map
    if inputs != ["positions", "directions"] or not {"box", "transform"} <= set(facts):
        raise checks.InputError(
            f"{path}: holds no field of a single shape (its inputs: {', '.join(inputs)}); give what `ddf export` wrote "
            "of a field that `ddf fit` wrote"
        )
    try:
        lower, upper = (np.array(corner, dtype=np.float64).reshape(3) for corner in json.loads(facts["box"]))
        field_from_mesh = _similarity(facts["transform"])
    except (KeyError, TypeError, ValueError) as error:
        raise checks.InputError(f"{path}: its record lacks what a field needs ({error})") from error
    return OnnxField(session, lower, upper, field_from_mesh)


def _similarity(text: str) -> transforms.Similarity:
    """The map in the file; the identity where it says in words that there is none."""
    if text.startswith("none"):
        return transforms.Similarity()
    values: dict[str, Any] = json.loads(text)
    return transforms.Similarity.from_dict(values)


def _usable_cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]

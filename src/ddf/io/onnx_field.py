"""A field of one shape from its ONNX file, evaluated by onnxruntime: needs neither torch nor the file it came from."""

import json
import os
import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from jaxtyping import Float

from ddf.core import checks
from ddf.fields import field_outputs, framed_field
from ddf.geometry import transforms

_LARGEST = 256 << 20  # bytes of a file
_FEW = 400 << 20  # bytes of memory that any file may take; a larger one a hundred times its own
_ROWS = 4096  # at once, for memory alone
_FOLDED = "optimization.constant_folding_max_output_size_in_bytes"
_PLACE = re.compile(r"\[ONNXRuntimeError\] : \d+ : \w+ : |/onnxruntime_src/\S+.*?\)(?= [A-Z])")
_MOST_STEPS = 6 << 14  # of a ray through patches
_LOOPS = (b"\x22\x04Loop", b"\x22\x04Scan", b"\x22\x02If", b"\x22\x0bSequenceMap")  # as a graph spells its operators


@dataclass(frozen=True)
class OnnxField:
    """A session, and what the file says of its box (field frame) and of the map to its frame: a `FramedField`."""

    session: onnxruntime.InferenceSession
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    field_from_mesh: transforms.Similarity

    @property
    def outputs(self) -> tuple[str, ...]:
        """Those of the file that this version knows."""
        return tuple(output.name for output in self.session.get_outputs() if output.name in field_outputs.OUTPUTS)

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs inside the box, field frame, float32."""
        if len(positions) == 0:  # files of earlier versions need a row
            one_row = self.evaluate(np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]), outputs)
            return {name: values[:0] for name, values in one_row.items()}
        asked = [name for name in self.outputs if name in outputs]
        inputs = {"positions": positions.astype(np.float32), "directions": directions.astype(np.float32)}
        parts = [
            self.session.run(asked, {name: values[start : start + _ROWS] for name, values in inputs.items()})
            for start in range(0, len(positions), _ROWS)
        ]
        found = dict(zip(asked, map(np.concatenate, zip(*parts, strict=True)), strict=True))
        for name, values in found.items():
            shape = (len(positions), *((3,) if field_outputs.OUTPUTS[name].kind == "directions" else ()))
            if values.dtype != np.float32 or values.shape != shape:
                raise ValueError(f"output {name[:40]!r} must be float32 of shape {shape}; it is {values.shape}")
        return found


def load(path: Path) -> OnnxField:
    """The field of an ONNX file that `ddf export` wrote of what `ddf fit` wrote."""
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such file; give an ONNX file that `ddf export` wrote")
    checks.require_content(path)
    if path.stat().st_size > _LARGEST:
        raise checks.InputError(f"{path}: {path.stat().st_size} bytes; at most {_LARGEST} are read")
    data = path.read_bytes()  # read here, so that no weights outside the file are followed
    looping = [word.decode()[2:] for word in _LOOPS for _ in range(data.count(word))]
    if looping and (looping != ["Loop"] or not _is_bounded(data)):
        raise checks.InputError(f"{path}: has a node {looping[0]}, as no file of `ddf export` has")
    options = onnxruntime.SessionOptions()
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    options.intra_op_num_threads = cores  # named, so that onnxruntime pins none of them
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")  # it doubles the time of a busy machine
    options.log_severity_level = 4
    arena = onnxruntime.OrtArenaCfg(max(_FEW, 100 * len(data)), -1, -1, -1)  # bytes at most; the rest as it is
    kinds = onnxruntime.OrtAllocatorType, onnxruntime.OrtMemType
    memory = onnxruntime.OrtMemoryInfo("Cpu", kinds[0].ORT_ARENA_ALLOCATOR, 0, kinds[1].DEFAULT)
    onnxruntime.create_and_register_allocator(memory, arena)  # of the sessions that follow
    options.add_session_config_entry("session.use_env_allocators", "1")
    options.add_session_config_entry(_FOLDED, str(max(_FEW // 16, 4 * len(data))))
    try:
        how: dict[str, Any] = {"providers": ["CPUExecutionProvider"], "enable_fallback": 0}  # which would try again
        session = onnxruntime.InferenceSession(data, options, **how)
        inputs = [value.name for value in session.get_inputs()]
        facts = session.get_modelmeta().custom_metadata_map
    except Exception as error:  # onnxruntime has a class of its own per fault, none of them public
        raise checks.InputError(f"{path}: not an ONNX file that onnxruntime reads: {_line(error)}") from error
    if inputs != ["positions", "directions"] or not {"box", "transform"} <= set(facts):
        raise checks.InputError(
            f"{path}: holds no field of a single shape (its inputs: {', '.join(inputs)[:80]}); give what `ddf export` "
            "wrote of a field that `ddf fit` wrote"
        )
    with framed_field.record_of(path):
        field = OnnxField(session, *framed_field.corners(*json.loads(facts["box"])), _similarity(facts["transform"]))
    try:
        probe = field.evaluate(np.zeros((2, 3)), np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]), field.outputs)
    except Exception as error:
        raise checks.InputError(f"{path}: its graph does not give what a field gives: {_line(error)}") from error
    unfit = {"visibility", "depth"} - set(probe) or {name for name, values in probe.items() if np.isnan(values).any()}
    if unfit:
        raise checks.InputError(f"{path}: gives no {min(unfit)[:40]}, or values that are not numbers")
    return field


def _is_bounded(data: bytes) -> bool:
    """Whether the one loop of a graph, that of `patch_graph`, ends after a number of steps that the file states."""
    import onnx  # what onnxruntime knows of a graph is too little

    try:
        graph = onnx.load_from_string(data).graph
        (loop,) = (node for node in graph.node if node.op_type == "Loop")
        (steps,) = (each for each in graph.initializer if each.name == loop.input[0])
        return 0 <= int(onnx.numpy_helper.to_array(steps)) <= _MOST_STEPS
    except Exception:  # onnx has several of its own for what is no graph
        return False


def _similarity(text: str) -> transforms.Similarity:
    """The map in the file; the identity where it says in words that there is none."""
    return transforms.Similarity() if text.startswith("none") else transforms.Similarity.from_dict(json.loads(text))


def _line(error: Exception) -> str:
    """What onnxruntime says, without the place in its source; of a later format, what helps."""
    said = _PLACE.sub("", " ".join(str(error).split()))
    return f"{said}; update onnxruntime" if re.search(r"IR version|opset", said) else said

"""How samples may be stored: bytes per sample, what rounding costs, seconds to encode and decode a shape's samples.

Candidates store the same drawn samples of one shape; the errors of position, direction, depth and normal are those of
the decoded values. `packing` rounds before it casts, so that there position and direction errors move a sample and do
not falsify it; the truth of every other candidate belongs to another ray than the stored one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from bench.lib import display, measured_shapes, measuring
from ddf.data import mesh_preparation, packing
from ddf.data.mesh_config import MeshesConfig
from ddf.geometry import raycast, rays

COUNT, REPEATS, THREADS = 200_000, 21, 1
_SPAN = 2 * 3**0.5  # the largest depth in the cube
Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Storage:
    """How each field becomes small, and comes back as float32 tensors."""

    encode: Mapping[str, Callable[[np.ndarray], np.ndarray]]
    decode: Mapping[str, Callable[[Tensor], Tensor]]


def truth() -> Arrays:
    """What random rays see of a procedural chair, exact: float64 rays and hits."""
    mesh = mesh_preparation.prepare(
        measured_shapes.procedural("chair", 3), MeshesConfig(wrap="never"), np.random.default_rng(0)
    ).mesh
    rng = np.random.default_rng(0)
    positions, directions = rng.uniform(-1, 1, (COUNT, 3)), rng.standard_normal((COUNT, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = raycast.cast(mesh, rays.OrientedPoints(torch.from_numpy(positions), torch.from_numpy(directions)))
    seen = hits.visible.numpy()
    found: dict[str, np.ndarray] = {"depth": hits.depth.numpy()[seen], "normals": hits.normals.numpy()[seen]}
    return {"positions": positions[seen], "directions": directions[seen], **found}


def floats(dtype: type[np.floating]) -> Storage:
    """Every coordinate in a float type."""
    names = packing.FIELDS
    return Storage(dict.fromkeys(names, lambda a: a.astype(dtype)), dict.fromkeys(names, lambda t: t.float()))


def integers(positions: int, directions: int, depth: int, normals: int) -> Storage:
    """Fixed point of so many bits per number; unit vectors by the octahedral map."""
    signed = {8: np.int8, 16: np.int16}
    unsigned, steps = {8: np.uint8, 16: np.uint16}[depth], 2**depth - 2  # the last code is a miss
    top = 2 ** (positions - 1) - 1
    return Storage(
        {
            "positions": lambda a: np.rint(a * top).astype(signed[positions]),
            "directions": lambda a: packing.encode_unit(a, signed[directions]),
            "depth": lambda a: np.rint(a * (steps / _SPAN)).astype(unsigned),
            "normals": lambda a: packing.encode_unit(a, signed[normals]),
        },
        {
            "positions": lambda t: t.float() / top,
            "directions": packing.decode_unit,
            "depth": lambda t: t.to(torch.int32).float() * (_SPAN / steps),
            "normals": packing.decode_unit,
        },
    )


def as_packed() -> Storage:
    """What `ddf.data.packing` does."""
    return Storage(
        {
            "positions": packing.encode_positions,
            "directions": lambda a: packing.encode_unit(a, np.int16),
            "depth": packing.encode_depth,
            "normals": lambda a: packing.encode_unit(a, np.int8),
        },
        {
            "positions": packing.decode_positions,
            "directions": packing.decode_unit,
            "depth": packing.decode_depth,
            "normals": packing.decode_unit,
        },
    )


CANDIDATES = {
    "float32": floats(np.float32),
    "float16": floats(np.float16),
    "packing: int16, normals int8": as_packed(),
    "int16": integers(16, 16, 16, 16),
    "int16, directions and normals int8": integers(16, 8, 16, 8),
    "int16, depth uint8, normals int8": integers(16, 16, 8, 8),
    "int8": integers(8, 8, 8, 8),
}


def angles_deg(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Between vectors, accurate for small ones."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)))


def errors(decoded: Arrays, exact: Arrays) -> dict[str, float]:
    """Largest and median of each field's error; field units and degrees."""
    each = {
        "position": np.linalg.norm(decoded["positions"] - exact["positions"], axis=1),
        "direction_deg": angles_deg(decoded["directions"], exact["directions"]),
        "depth": np.abs(decoded["depth"] - exact["depth"]),
        "normal_deg": angles_deg(decoded["normals"], exact["normals"]),
    }
    return {
        f"{name}_{word}": float(of(values))
        for name, values in each.items()
        for word, of in (("max", np.max), ("median", np.median))
    }


def measure(name: str, storage: Storage, exact: Arrays) -> list[dict[str, Any]]:
    """Rows of encoding and of decoding."""

    def encode() -> Arrays:
        return {field: storage.encode[field](values) for field, values in exact.items()}

    stored = {field: torch.from_numpy(values) for field, values in encode().items()}

    def decode() -> dict[str, Tensor]:
        return {field: storage.decode[field](values) for field, values in stored.items()}

    found = errors({field: values.double().numpy() for field, values in decode().items()}, exact)
    count = len(exact["depth"])
    size = {"samples": count, "bytes_per_sample": sum(t.nbytes for t in stored.values()) / count}
    times = measuring.interleaved({f"encode {name}": encode, f"decode {name}": decode}, REPEATS)
    return [measuring.row(way, size, seconds, found) for way, seconds in times.items()]


def _stored(error: str, label: str) -> display.View:
    """Bytes of a sample against an error; decoding has the same."""
    return display.View(
        error,
        label,
        lambda _: label.partition(",")[0],
        keep=lambda row: row.what.startswith("encode"),
        cost=lambda row: row.size["bytes_per_sample"],
        cost_label="bytes a sample",
    )


SECTION = display.Section(
    views=(
        _stored("position_max", "position, field units, largest error"),
        _stored("direction_deg_max", "direction, degrees, largest error"),
        _stored("depth_max", "depth, field units, largest error"),
        _stored("normal_deg_max", "normal, degrees, largest error"),
    )
)


def main() -> None:
    """Measure every candidate on the same samples."""
    torch.set_num_threads(THREADS)
    exact = truth()
    rows = [row for name, storage in CANDIDATES.items() for row in measure(name, storage, exact)]
    measuring.write("storage", THREADS, rows)

"""Accessors of glTF: typed arrays in a buffer, strided, `normalized`, sparse."""

from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.formats import raw

_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def whole(value: Any, name: str) -> int:
    """`value` if it is a whole number from 0 on."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 53:
        raise checks.InputError(f"{name} must be a whole number; got {str(value)[:40]!r}")
    return value


class Accessors:
    """The accessors of one file; every read is checked against the bytes that are there."""

    def __init__(self, tree: dict[str, Any], buffers: list[bytes]) -> None:
        self._accessors, self._views, self._buffers = tree.get("accessors", []), tree.get("bufferViews", []), buffers
        self._room = 16 + sum(map(len, buffers))
        for entry in self._accessors:
            raw.require_room("accessor entries", whole(entry["count"], "count"), 1, self._room)

    def count(self, index: Any) -> int:
        """Entries of an accessor."""
        return whole(self._entry(self._accessors, index, "accessor")["count"], "count")

    def positions(self, index: Any) -> Float[np.ndarray, "n 3"]:
        """Positions: floats, or integers that KHR_mesh_quantization allows, divided as `normalized` asks."""
        entry = self._entry(self._accessors, index, "accessor")
        values = self._read(entry, "VEC3")
        kind = values.dtype
        positions = raw.widened(values)
        if entry.get("normalized", False) and kind.kind in "iu":
            positions = np.maximum(positions / np.iinfo(kind).max, -1.0)
        return positions

    def indices(self, index: Any) -> Int[np.ndarray, "n"]:
        """Indices of vertices: unsigned integers."""
        values = self._read(self._entry(self._accessors, index, "accessor"), "SCALAR")
        if values.dtype.kind != "u":
            raise checks.InputError(f"indices must be unsigned integers; got {values.dtype}")
        return values.reshape(-1).astype(np.int64)

    def _entry(self, table: list[Any], index: Any, name: str) -> dict[str, Any]:
        if whole(index, name) >= len(table):
            raise checks.InputError(f"{name} {index} does not exist; there are {len(table)}")
        return table[index]

    def _read(self, entry: dict[str, Any], kind: str) -> np.ndarray:
        if entry["type"] != kind or entry["componentType"] not in _KINDS:
            raise checks.InputError(
                f"an accessor of {str(entry['type'])[:20]} and type {str(entry['componentType'])[:20]} stands where "
                f"{kind} must be"
            )
        component, width = np.dtype(_KINDS[entry["componentType"]]), _WIDTHS[kind]
        count = whole(entry["count"], "count")
        if "bufferView" in entry:
            values = self._strided(entry["bufferView"], entry.get("byteOffset", 0), component, width, count)
        elif "sparse" in entry:
            values = np.zeros((count, width), component)
        else:
            raise checks.InputError("an accessor has no data: the file keeps them compressed or elsewhere")
        sparse = entry.get("sparse")
        if sparse is None:
            return values
        return self._replaced(values, sparse)

    def _strided(self, view: Any, offset: Any, component: np.dtype, width: int, count: int) -> np.ndarray:
        entry = self._entry(self._views, view, "bufferView")
        buffer = self._buffers[self._buffer(entry)]
        begin = whole(entry.get("byteOffset", 0), "byteOffset")
        length = whole(entry["byteLength"], "byteLength")
        inner = whole(offset, "byteOffset")
        size = component.itemsize * width
        stride = whole(entry.get("byteStride", 0), "byteStride") or size
        if begin + length > len(buffer) or (count and inner + stride * (count - 1) + size > length):
            raise checks.InputError("an accessor reaches beyond its buffer")
        if stride < size:
            raise checks.InputError(f"byteStride {stride} is less than the {size} bytes of an entry")
        flat = np.frombuffer(buffer, np.uint8, (stride * (count - 1) + size) if count else 0, begin + inner)
        rows = np.lib.stride_tricks.as_strided(flat, (count, size), (stride, 1), writeable=False)
        return np.ascontiguousarray(rows).view(component).reshape(count, width)

    def _buffer(self, view: dict[str, Any]) -> int:
        index = whole(view["buffer"], "buffer")
        if index >= len(self._buffers):
            raise checks.InputError(f"buffer {index} does not exist; there are {len(self._buffers)}")
        return index

    def _replaced(self, values: np.ndarray, sparse: dict[str, Any]) -> np.ndarray:
        """Values with those that a sparse accessor gives put in their places."""
        count, index, new = whole(sparse["count"], "count"), sparse["indices"], sparse["values"]
        if index["componentType"] not in (5121, 5123, 5125):
            raise checks.InputError("sparse indices must be unsigned integers")
        raw.require_room("sparse entries", count, 1, len(values))
        kind = np.dtype(_KINDS[index["componentType"]])
        where = self._strided(index["bufferView"], index.get("byteOffset", 0), kind, 1, count).reshape(-1)
        if count and int(where.max()) >= len(values):
            raise checks.InputError(f"a sparse index is {int(where.max())}; the accessor has {len(values)} entries")
        changed = values.copy()
        changed[where.astype(np.int64)] = self._strided(
            new["bufferView"], new.get("byteOffset", 0), values.dtype, values.shape[1], count
        )
        return changed

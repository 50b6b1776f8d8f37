"""glTF 2.0, binary (GLB) and as text with buffers beside it: the triangles of its scene, transforms applied.

Our own reader: trimesh passes over required extensions, takes `normalized` integers as they are and drops fans.
Skins and morph targets are read in their rest shape, with a remark.
"""

import base64
import binascii
import json
import struct
import urllib.parse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry import transforms
from ddf.geometry.formats import raw, scenes

MAX_JSON = 64 << 20  # bytes of the JSON part: a tree ten times as large in memory
MAX_BUFFERS = 256 << 20  # bytes of all buffers beside a text file, as of a file that holds its own
MAX_BRACKETS, MAX_COMMAS = 1_000_000, 8_000_000  # of the JSON part: some hundred bytes of memory each, some tens
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp", "ADOBE_materials_")
_KNOWN = ("KHR_mesh_quantization", "MSFT_texture_dds", "KHR_animation_pointer", "EXT_lights_image_based")
_CHANGES_SHAPE = ("EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression", "EXT_meshopt_compression", "MSFT_lod")
_MOST = 100_000  # nodes, and primitives placed
_NO_TRIANGLES = {0: "points", 1: "lines", 2: "line loops", 3: "line strips"}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


def parse(data: bytes, folder: Path | None = None, as_text: bool = False) -> raw.Raw:
    """All triangles of the scene, in the order of its nodes, transforms applied.

    Args:
      as_text: a text file (.gltf), whose buffers lie in `folder` or in data URIs.
    Raises:
      InputError: no glTF, cut short, an extension that changes the shape and is not read, anything that points at
        nothing or outside the file, its folder and what lies below; buffers of more than 256 MiB.
    """
    kind, (text, binary) = ("gltf", (data, None)) if as_text else ("glb", _chunks(data))
    if len(text) > MAX_JSON:
        raise checks.InputError(f"its JSON has {len(text)} bytes; at most {MAX_JSON} are read: save it as .glb")
    if text.count(b"[") + text.count(b"{") > MAX_BRACKETS:
        raise checks.InputError(f"its JSON has more than {MAX_BRACKETS} lists and objects")
    if text.count(b",") > MAX_COMMAS:
        raise checks.InputError(f"its JSON has more than {MAX_COMMAS} entries")
    try:
        tree = json.loads(text)
        if not isinstance(tree, dict):
            raise ValueError
    except (ValueError, RecursionError) as fault:
        raise checks.InputError(f"not a {kind} mesh: its JSON chunk cannot be read") from fault
    try:
        if kind == "gltf" and str(tree["asset"]["version"]).split(".")[0] != "2":
            raise checks.InputError(f"glTF version {str(tree['asset']['version'])[:20]} is not read; only 2 is")
        _check_extensions(tree)
        return _File(tree, _buffers(tree, binary, folder)).scene()
    except (KeyError, TypeError, AttributeError, IndexError) as fault:  # a tree of another shape than glTF's
        reason = f"{type(fault).__name__}: {' '.join(str(fault).split())[:80]}"
        raise checks.InputError(f"not a {kind} mesh: its JSON is not glTF ({reason})") from fault


def _chunks(data: bytes) -> tuple[bytes, bytes]:
    if len(data) < 20 or data[:4] != b"glTF":
        raise checks.InputError("not a glb mesh: no glTF header")
    version, total = struct.unpack("<II", data[4:12])
    if version != 2:
        raise checks.InputError(f"glTF version {version} is not read; only 2 is")
    if total > len(data):
        raise checks.InputError(f"cut short: the header claims {total} bytes, the file has {len(data)}")
    chunks: dict[int, bytes] = {}
    place = 12
    while place + 8 <= total:
        length, kind = struct.unpack("<II", data[place : place + 8])
        if place + 8 + length > total:
            raise checks.InputError(f"cut short: a chunk claims {length} bytes, {total - place - 8} follow")
        if kind in (_JSON, _BINARY):
            chunks.setdefault(kind, data[place + 8 : place + 8 + length])
        place += 8 + length
    if _JSON not in chunks:
        raise checks.InputError("not a glb mesh: it has no JSON chunk")
    return chunks[_JSON].rstrip(b"\0"), chunks.get(_BINARY, b"")  # some writers pad with zeros in place of spaces


def _check_extensions(tree: dict[str, Any]) -> None:
    for name in tree.get("extensionsRequired", []):
        if not str(name).startswith(_HARMLESS) and name not in _KNOWN:
            raise checks.InputError(f"the file requires {name}, which is not read; export it without")
    used = [name for name in tree.get("extensionsUsed", []) if name in _CHANGES_SHAPE]
    if used:
        raise checks.InputError(f"the file uses {used[0]}, which is not read; export it without")


def _buffers(tree: dict[str, Any], binary: bytes | None, folder: Path | None) -> list[bytes]:
    """The bytes of all buffers; of a GLB, the first is its own."""
    buffers: list[bytes] = []
    left = MAX_BUFFERS
    for i, entry in enumerate(tree.get("buffers", [])):
        wanted = _whole(entry["byteLength"], "byteLength")
        if "uri" in entry:
            if wanted > left:
                raise checks.InputError(f"its buffers have more than {MAX_BUFFERS} bytes")
            buffers.append(_outside(str(entry["uri"]), wanted, None if binary is not None else folder))
        elif binary is not None and i == 0:
            buffers.append(binary)
        else:
            raise checks.InputError(f"buffer {i} has no data")
        left -= len(buffers[-1])
        if wanted > len(buffers[-1]):
            raise checks.InputError(f"cut short: a buffer of {wanted} bytes, {len(buffers[-1])} are there")
    return buffers


def _outside(uri: str, wanted: int, folder: Path | None) -> bytes:
    """The bytes behind the address of a buffer: a data URI, or a file in the folder or below it."""
    if uri.startswith("data:"):
        head, _, body = uri.partition(",")
        if not head.endswith(";base64"):
            raise checks.InputError("a data URI of a buffer must be base64")
        try:
            return base64.b64decode(body, validate=True)
        except (binascii.Error, ValueError) as fault:
            raise checks.InputError("a data URI of a buffer is not base64") from fault
    if folder is None:
        raise checks.InputError("a file that is read alone must hold its own buffers; this one points outside itself")
    name = urllib.parse.unquote(uri)
    fault = f"buffer {name[:80]!a}: "
    try:
        path = (folder / name).resolve()
        if not path.is_relative_to(folder.resolve()) or "\\" in name or ":" in name:
            raise checks.InputError(fault + "must lie in the folder of the file")
        if not path.is_file():
            raise checks.InputError(fault + "no such file")
        with path.open("rb") as file:
            return file.read(wanted)
    except checks.InputError:
        raise
    except (OSError, ValueError) as cause:  # a name too long, a zero byte, no permission
        raise checks.InputError(fault + "cannot be read") from cause


def _whole(value: Any, name: str) -> int:
    """`value` if it is a whole number from 0 on."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 53:
        raise checks.InputError(f"{name} must be a whole number; got {str(value)[:40]!r}")
    return value


class _File:
    """The tables of one file; every read of an accessor is checked against the bytes that are there."""

    def __init__(self, tree: dict[str, Any], buffers: list[bytes]) -> None:
        self._tree, self._buffers = tree, buffers
        room = 16 + sum(map(len, buffers))
        for entry in tree.get("accessors", []):
            raw.require_room("accessor entries", _whole(entry["count"], "count"), 1, room)

    def scene(self) -> raw.Raw:
        """Vertices and triangles of every primitive of every node, in the scene's frame."""
        scene = scenes.Scene(_MOST)
        for node, matrix in self._nodes():
            if "mesh" not in node:
                continue
            mesh = self._tree.get("meshes", [])[_whole(node["mesh"], "mesh")]
            if "skin" in node:
                scene.remarks["skins are not applied: the mesh is read as modelled"] = None
            if any(node.get("weights", mesh.get("weights", ()))):
                scene.remarks["morph targets are not applied"] = None
            for primitive in mesh["primitives"]:
                mode = primitive.get("mode", _TRIANGLES)
                if mode in _NO_TRIANGLES:
                    scene.remarks[f"primitives of {_NO_TRIANGLES[mode]} are left out"] = None
                    continue
                named = [primitive["attributes"]["POSITION"]]
                named += [primitive["indices"]] if "indices" in primitive else []
                scene.require_room(max(_whole(self._entry("accessors", i)["count"], "count") for i in named))
                scene.place(self._primitive(primitive, mode), matrix)
        return scene.joined()

    def _nodes(self) -> Iterator[tuple[dict[str, Any], Float[np.ndarray, "4 4"]]]:
        """Nodes of the scene from its roots down, each with the product of the transforms above it."""
        nodes, listed = self._tree.get("nodes", []), self._tree.get("scenes", [])
        below = {child for node in nodes for child in node.get("children", [])} if not listed else set()
        roots = [i for i in range(len(nodes)) if i not in below]
        if listed:
            roots = list(listed[_whole(self._tree.get("scene", 0), "scene")].get("nodes", []))
        stack = [(root, np.eye(4)) for root in reversed(roots)]
        seen: set[int] = set()
        while stack:
            index, above = stack.pop()
            node = self._entry("nodes", index)
            if index in seen:
                raise checks.InputError(f"node {index} hangs in the scene twice, or in a circle")
            seen.add(index)
            if len(seen) > _MOST:
                raise checks.InputError(f"the scene has more than {_MOST} nodes")
            matrix = scenes.product(above, _local(node))
            yield node, matrix
            stack += [(child, matrix) for child in reversed(node.get("children", []))]

    def _primitive(self, primitive: dict[str, Any], mode: Any) -> scenes.Part:
        vertices = self._positions(primitive["attributes"]["POSITION"])
        index = self._indices(primitive["indices"]) if "indices" in primitive else np.arange(len(vertices))
        if len(index) and index.max() >= len(vertices):
            raise checks.InputError(f"a triangle uses vertex {index.max()}, but there are only {len(vertices)}")
        if mode == _TRIANGLES:
            if len(index) % 3:
                raise checks.InputError(f"{len(index)} indices of triangles: not a multiple of three")
            return vertices, index.reshape(-1, 3)
        if mode == _STRIP or len(index) < 3:
            return vertices, scenes.strip(index)
        if mode == _FAN:
            return vertices, np.stack([index[1:-1], index[2:], np.full(len(index) - 2, index[0])], axis=1)
        raise checks.InputError(f"primitive mode {str(mode)[:20]} is none of glTF's")

    def _positions(self, index: Any) -> Float[np.ndarray, "n 3"]:
        """Positions: floats, or integers that KHR_mesh_quantization allows, divided as `normalized` asks."""
        entry = self._entry("accessors", index)
        values = self._accessor(entry, "VEC3", 3)
        positions = raw.widened(values)
        if entry.get("normalized", False) and values.dtype.kind in "iu":
            positions = np.maximum(positions / np.iinfo(values.dtype).max, -1.0)
        return positions

    def _indices(self, index: Any) -> Int[np.ndarray, "n"]:
        values = self._accessor(self._entry("accessors", index), "SCALAR", 1)
        if values.dtype.kind != "u":
            raise checks.InputError(f"indices must be unsigned integers; got {values.dtype}")
        return values.reshape(-1).astype(np.int64)

    def _entry(self, table: str, index: Any) -> dict[str, Any]:
        entries, name = self._tree.get(table, []), table[:-1]
        if _whole(index, name) >= len(entries):
            raise checks.InputError(f"{name} {index} does not exist; there are {len(entries)}")
        return entries[index]

    def _accessor(self, entry: dict[str, Any], kind: str, width: int) -> np.ndarray:
        if entry["type"] != kind or entry["componentType"] not in _KINDS:
            got = f"{str(entry['type'])[:20]} and type {str(entry['componentType'])[:20]}"
            raise checks.InputError(f"an accessor of {got} stands where {kind} must be")
        component, count = np.dtype(_KINDS[entry["componentType"]]), _whole(entry["count"], "count")
        if "sparse" in entry:
            raise checks.InputError("an accessor is sparse, which is not read; export it without")
        if "bufferView" not in entry:
            raise checks.InputError("an accessor has no data: the file keeps them compressed or elsewhere")
        view, inner = self._entry("bufferViews", entry["bufferView"]), entry.get("byteOffset", 0)
        which = _whole(view["buffer"], "buffer")
        if which >= len(self._buffers):
            raise checks.InputError(f"buffer {which} does not exist; there are {len(self._buffers)}")
        begin, inner = (_whole(each, "byteOffset") for each in (view.get("byteOffset", 0), inner))
        length, size = _whole(view["byteLength"], "byteLength"), component.itemsize * width
        stride = _whole(view.get("byteStride", 0), "byteStride") or size
        used = stride * (count - 1) + size if count else 0
        if begin + length > len(self._buffers[which]) or (count and inner + used > length):
            raise checks.InputError("an accessor reaches beyond its buffer")
        if stride < size:
            raise checks.InputError(f"byteStride {stride} is less than the {size} bytes of an entry")
        flat = np.frombuffer(self._buffers[which], np.uint8, used, begin + inner)
        rows = np.lib.stride_tricks.as_strided(flat, (count, size), (stride, 1), writeable=False)
        return np.ascontiguousarray(rows).view(component).reshape(count, width)


def _local(node: dict[str, Any]) -> Float[np.ndarray, "4 4"]:
    """The node's own transform: a matrix by columns, or scale, then rotation (x, y, z, w), then translation."""
    if "matrix" in node:
        return scenes.numbers(node["matrix"], 16, "matrix").reshape(4, 4).T
    matrix = np.eye(4)
    quaternion = scenes.numbers(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), 4, "rotation")
    if not 0 < float(np.linalg.norm(quaternion)) < float("inf"):
        raise checks.InputError("the rotation of a node must not be zero")
    turn = transforms.rotation_of(quaternion)
    matrix[:3, :3] = turn * scenes.numbers(node.get("scale", (1.0, 1.0, 1.0)), 3, "scale")
    matrix[:3, 3] = scenes.numbers(node.get("translation", (0.0, 0.0, 0.0)), 3, "translation")
    return matrix

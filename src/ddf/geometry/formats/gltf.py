"""Binary glTF 2.0 (GLB): the container, what the file requires, and the triangles of its scene.

Our own reader: trimesh passes over required extensions, takes `normalized` integers as they are and drops fans.
Skins and morph targets are read in their rest shape, with a remark.
"""

import json
import struct
from typing import Any

import numpy as np

from ddf.core import checks
from ddf.geometry.formats import gltf_accessors, gltf_scene, raw

MAX_JSON = 64 << 20  # bytes of the JSON chunk: a tree ten times as large in memory
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_xmp", "ADOBE_materials_")
_KNOWN = ("KHR_mesh_quantization", "MSFT_texture_dds", "KHR_animation_pointer", "EXT_lights_image_based")
_CHANGES_SHAPE = ("EXT_mesh_gpu_instancing", "KHR_draco_mesh_compression", "EXT_meshopt_compression", "MSFT_lod")


def parse(data: bytes) -> raw.Raw:
    """All triangles of the scene, in the order of its nodes, transforms applied.

    Raises:
      InputError: no GLB, cut short, an extension that changes the shape and is not read, anything that points at
        nothing or outside the file.
    """
    tree, binary = _chunks(data)
    try:
        _check_extensions(tree)
        buffers = _buffers(tree, binary)
        return _joined(tree, gltf_accessors.Accessors(tree, buffers))
    except (KeyError, TypeError, AttributeError, IndexError) as fault:  # a tree of another shape than glTF's
        reason = " ".join(str(fault).split())[:80]
        raise checks.InputError(f"not a glb mesh: its JSON is not glTF ({type(fault).__name__}: {reason})") from fault


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
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
    if len(chunks.get(_JSON, b"")) > MAX_JSON:
        raise checks.InputError(f"the JSON chunk has {len(chunks[_JSON])} bytes; at most {MAX_JSON} are read")
    try:
        tree = json.loads(chunks[_JSON])
        if not isinstance(tree, dict):
            raise ValueError
    except (ValueError, KeyError, RecursionError) as fault:
        raise checks.InputError("not a glb mesh: its JSON chunk cannot be read") from fault
    return tree, chunks.get(_BINARY, b"")


def _check_extensions(tree: dict[str, Any]) -> None:
    for name in tree.get("extensionsRequired", []):
        if not str(name).startswith(_HARMLESS) and name not in _KNOWN:
            raise checks.InputError(f"the file requires {name}, which is not read; export it without")
    used = [name for name in tree.get("extensionsUsed", []) if name in _CHANGES_SHAPE]
    if used:
        raise checks.InputError(f"the file uses {used[0]}, which is not read; export it without")


def _buffers(tree: dict[str, Any], binary: bytes) -> list[bytes]:
    buffers = []
    for i, entry in enumerate(tree.get("buffers", [])):
        if "uri" in entry or i:
            raise checks.InputError("glb files must hold their own buffers; this one points outside itself")
        if gltf_accessors.whole(entry["byteLength"], "byteLength") > len(binary):
            raise checks.InputError(f"cut short: a buffer of {entry['byteLength']} bytes, {len(binary)} are there")
        buffers.append(binary)
    return buffers


def _joined(tree: dict[str, Any], accessors: gltf_accessors.Accessors) -> raw.Raw:
    parts, remarks = gltf_scene.parts(tree, accessors)
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    vertices = np.concatenate([np.zeros((0, 3)), *(vertices for vertices, _ in parts)])
    raw.require_coordinates(vertices)
    faces = [faces + offset for (_, faces), offset in zip(parts, offsets[:-1], strict=True)]
    return raw.Raw(vertices, np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces]), remarks)

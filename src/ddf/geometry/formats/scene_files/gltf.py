"""glTF 2.0, binary (GLB) and as text with buffers beside it: the container, what it requires, its scene's triangles.

Our own reader: trimesh passes over required extensions, takes `normalized` integers as they are and drops fans.
Skins and morph targets are read in their rest shape, with a remark.
"""

import base64
import binascii
import json
import struct
import urllib.parse
from pathlib import Path
from typing import Any

from ddf.core import checks
from ddf.geometry.formats import raw
from ddf.geometry.formats.scene_files import gltf_accessors, gltf_scene, parts

MAX_JSON = 64 << 20  # bytes of the JSON part: a tree ten times as large in memory
MAX_BUFFERS = 256 << 20  # bytes of all buffers beside a text file, as of a file that holds its own
MAX_BRACKETS, MAX_COMMAS = 1_000_000, 8_000_000  # of the JSON part: some hundred bytes of memory each, some tens
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
    text, binary = _chunks(data)
    return _read(text, "glb", binary, None)


def parse_text(data: bytes, folder: Path | None) -> raw.Raw:
    """The same of a text file (.gltf), whose buffers lie in `folder` or in data URIs.

    Raises:
      InputError: as `parse`; a buffer that is not in the folder or below it, or all are of more than 256 MiB.
    """
    return _read(data, "gltf", None, folder)


def _read(text: bytes, kind: str, binary: bytes | None, folder: Path | None) -> raw.Raw:
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
        accessors = gltf_accessors.Accessors(tree, _buffers(tree, binary, folder))
        return parts.joined(*gltf_scene.of_scene(tree, accessors))
    except (KeyError, TypeError, AttributeError, IndexError) as fault:  # a tree of another shape than glTF's
        reason = " ".join(str(fault).split())[:80]
        raise checks.InputError(
            f"not a {kind} mesh: its JSON is not glTF ({type(fault).__name__}: {reason})"
        ) from fault


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
    """The bytes of all buffers. binary: of a GLB, which holds its own. folder: of a text file."""
    buffers: list[bytes] = []
    left = MAX_BUFFERS
    for i, entry in enumerate(tree.get("buffers", [])):
        wanted = gltf_accessors.whole(entry["byteLength"], "byteLength")
        if "uri" in entry:
            buffers.append(_outside(str(entry["uri"]), wanted, left, None if binary is not None else folder))
        elif binary is not None and i == 0:
            buffers.append(binary)
        else:
            raise checks.InputError(f"buffer {i} has no data")
        left -= len(buffers[-1])
        if wanted > len(buffers[-1]):
            raise checks.InputError(f"cut short: a buffer of {wanted} bytes, {len(buffers[-1])} are there")
    return buffers


def _outside(uri: str, wanted: int, left: int, folder: Path | None) -> bytes:
    """The bytes behind the address of a buffer: a data URI, or a file in the folder or below it.

    Args:
      wanted: bytes that the file says it has. left: bytes that may still be read. folder: None where there is none.
    """
    if wanted > left:
        raise checks.InputError(f"its buffers have more than {MAX_BUFFERS} bytes")
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
    try:
        path = (folder / name).resolve()
        inside = path.is_relative_to(folder.resolve()) and "\\" not in name and ":" not in name
        if not inside:
            raise checks.InputError(f"buffer {name[:80]!a}: must lie in the folder of the file")
        if not path.is_file():
            raise checks.InputError(f"buffer {name[:80]!a}: no such file")
        with path.open("rb") as file:
            return file.read(wanted)
    except (OSError, ValueError) as fault:  # a name too long, a zero byte, no permission
        if isinstance(fault, checks.InputError):
            raise
        raise checks.InputError(f"buffer {name[:80]!a}: cannot be read") from fault

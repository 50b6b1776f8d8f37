"""Point clouds as PLY files: read the vertices of any PLY, write little-endian binary ones.

Nothing is allocated for what a header claims: the bytes are counted first. Coordinates are widened to float64 and not
changed.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from ddf.core import checks

_TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2"}
_TYPES |= {"uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"}
_TYPES |= {"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_MAX_BYTES = 2 << 30  # clouds here have thousands of points; 2 GiB is a wrong file


def read_points(path: Path | str) -> Float[np.ndarray, "n 3"]:
    """Vertices of a PLY cloud or mesh, float64, in the file's order; faces, colours and normals are not read.

    Raises:
      FileNotFoundError: no such file.
      InputError: not a PLY whose vertices can be read whole, no vertices, or one that is not finite; the file is named.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if not path.is_file():
        raise checks.InputError(f"{path}: not a file; give a PLY cloud")
    if path.stat().st_size > _MAX_BYTES:
        raise checks.InputError(f"{path}: {path.stat().st_size} bytes; clouds must be at most {_MAX_BYTES}")
    try:
        points = _parse(path.read_bytes())
        checks.require_finite("points", points)
    except checks.InputError as fault:
        raise checks.InputError(f"{path}: {fault}") from fault
    return points


def points_ply(points: Float[np.ndarray, "n 3"]) -> bytes:
    """A binary PLY of float32 vertices."""
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    return header.encode() + np.ascontiguousarray(points, dtype="<f4").tobytes()


def _parse(data: bytes) -> Float[np.ndarray, "n 3"]:
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise checks.InputError("not a PLY file: no header that begins with 'ply' and ends with 'end_header'")
    lines = [line.split() for line in data[:end].decode("ascii", "replace").splitlines()[1:]]
    form = next((words[1] for words in lines if words[:1] == ["format"] and len(words) >= 2), "")
    count, names, types = _vertex_layout(lines)
    if count == 0:
        raise checks.InputError("the cloud has no points")
    body = data[end + len(b"end_header") :]
    body = body[2:] if body.startswith(b"\r\n") else body[1:]
    if form == "ascii":
        table = _ascii_rows(body, count, len(names))
        return np.stack([table[:, names.index(axis)] for axis in "xyz"], axis=1)
    if form not in _ORDERS:
        raise checks.InputError(f"PLY format must be ascii or binary; got {form or 'none'!r}")
    row = np.dtype([(name, _ORDERS[form] + kind) for name, kind in zip(names, types, strict=True)])
    if count * row.itemsize > len(body):
        raise checks.InputError(
            f"the header claims {count} points of {row.itemsize} bytes; only {len(body)} bytes follow"
        )
    table = np.frombuffer(body, row, count)
    return np.stack([table[axis].astype(np.float64) for axis in "xyz"], axis=1)


def _vertex_layout(lines: list[list[str]]) -> tuple[int, list[str], list[str]]:
    """Count, property names and numpy types of the vertex element, which must come first, as it does in practice."""
    elements = [i for i, words in enumerate(lines) if words[:1] == ["element"]]
    first = lines[elements[0]] if elements else []
    if len(first) != 3 or first[1] != "vertex" or not first[2].isdigit():
        raise checks.InputError("a PLY cloud must begin with 'element vertex <count>'")
    stop = elements[1] if len(elements) > 1 else len(lines)
    properties = [words for words in lines[elements[0] + 1 : stop] if words[:1] == ["property"]]
    if any(len(words) != 3 or words[1] not in _TYPES for words in properties):
        raise checks.InputError("the vertices of a PLY cloud must have plain number properties")
    names = [words[2] for words in properties]
    if len(set(names)) != len(names) or not {"x", "y", "z"} <= set(names):
        raise checks.InputError(
            f"the vertices of a PLY cloud must have x, y and z; got {', '.join(names) or 'nothing'}"
        )
    return int(first[2]), names, [_TYPES[words[1]] for words in properties]


def _ascii_rows(body: bytes, count: int, width: int) -> Float[np.ndarray, "n w"]:
    """The first `count` x `width` numbers of the body; what follows (faces) is not read."""
    if count * width * 2 > len(body) + 1:
        raise checks.InputError(f"the header claims {count} points; only {len(body)} bytes follow")
    words = body.split(None, count * width)[: count * width]
    if len(words) < count * width:
        raise checks.InputError(f"the header claims {count} points; the file ends after {len(words) // width}")
    try:
        return np.array(words, dtype=np.float64).reshape(count, width)
    except ValueError as fault:
        raise checks.InputError(f"a coordinate is not a number ({fault})") from fault

"""Triangle meshes in memory, and reading and writing them safely.

A file is judged before anything is allocated for it: its size, and the counts that its header claims against the bytes
that are there. Coordinates stay float64 and untouched (no welding, no reordering); scene graphs are flattened with
their transforms applied.
"""

import io
import json
import re
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb")
MAX_FILE_BYTES = 2 << 30  # a mesh of this project has 1e4 to 1e6 triangles; 2 GiB is a wrong file
_PLY_BYTES = {"char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2}
_PLY_BYTES |= {"int": 4, "uint": 4, "int32": 4, "uint32": 4, "float": 4, "float32": 4, "double": 8, "float64": 8}


@dataclass(frozen=True)
class Mesh:
    """Vertices (float64) and triangles (indices into them), in one frame.

    Raises:
      InputError: a coordinate is not finite, or an index points at no vertex.
    """

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.ascontiguousarray(self.faces, dtype=np.int64).reshape(-1, 3)
        checks.require_finite("vertices", vertices)
        if len(faces) and not (0 <= faces.min() and faces.max() < len(vertices)):
            bad = int(faces.min()) if faces.min() < 0 else int(faces.max())
            raise checks.InputError(f"faces must index the {len(vertices)} vertices; got index {bad}")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @property
    def triangles(self) -> Float[np.ndarray, "m 3 3"]:
        """Corner positions of every triangle."""
        return self.vertices[self.faces]

    def box(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Lower and upper corner of the box of the vertices that triangles use."""
        used = self.vertices[np.unique(self.faces)] if len(self.faces) else self.vertices
        if len(used) == 0:
            raise checks.InputError("the mesh must have vertices; got none")
        return used.min(axis=0), used.max(axis=0)

    def diagonal(self) -> float:
        """Length of the box's diagonal."""
        lower, upper = self.box()
        return float(np.linalg.norm(upper - lower))


def face_normals(mesh: Mesh) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, "m"]]:
    """Unit normals by the corners' order (zero for a degenerate triangle), and areas."""
    first, second, third = (mesh.vertices.take(mesh.faces[:, corner], axis=0).T for corner in range(3))
    (x, y, z), (u, v, w) = second - first, third - first
    cross = np.stack([y * w - z * v, z * u - x * w, x * v - y * u])  # np.cross takes three times as long
    length = np.sqrt(cross[0] ** 2 + cross[1] ** 2 + cross[2] ** 2)
    return np.ascontiguousarray((cross / np.where(length > 0, length, 1.0)).T), 0.5 * length


def load(path: Path | str) -> Mesh:
    """Read OBJ, PLY, STL, OFF or GLB as one triangle mesh, in the file's own frame and order.

    Raises:
      FileNotFoundError: no such file.
      InputError: not a mesh file that can be read whole; the message names the file and the fault.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if not path.is_file():
        raise checks.InputError(f"{path}: not a file; give one mesh ({', '.join(SUFFIXES)})")
    size = path.stat().st_size
    if size > MAX_FILE_BYTES:
        raise checks.InputError(f"{path}: {size} bytes; meshes must be at most {MAX_FILE_BYTES}")
    try:
        return parse(path.read_bytes(), path.suffix.lower())
    except checks.InputError as fault:
        raise checks.InputError(f"{path}: {fault}") from fault


def require_suffix(suffix: str) -> None:
    """Raise unless meshes with this suffix are read and written."""
    if suffix.lower() not in SUFFIXES:
        raise checks.InputError(f"mesh files must end in one of {', '.join(SUFFIXES)}; got {suffix or 'no suffix'}")


def parse(data: bytes, suffix: str) -> Mesh:
    """Read one mesh from the bytes of a file with this suffix.

    Raises:
      InputError: as `load`, without the file's name.
    """
    require_suffix(suffix)
    if not data.strip(b"\0 \t\r\n"):
        raise checks.InputError("the file is empty")
    if suffix == ".obj":
        mesh = _parse_obj(data)
    else:
        {".ply": _check_ply, ".stl": _check_stl, ".off": _check_off, ".glb": _check_glb}[suffix](data)
        mesh = _parse_with_trimesh(data, suffix)
    if len(mesh.faces) == 0:
        raise checks.InputError("no triangles found: not a mesh, or an empty one")
    return mesh


def _parse_with_trimesh(data: bytes, suffix: str) -> Mesh:
    import trimesh  # half a second and 80 MiB, which files that the checks refuse should not cost

    try:
        scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False)
        geometry = scene.to_mesh()
    except MemoryError as fault:
        raise checks.InputError("the file claims more than memory holds") from fault
    except Exception as fault:  # a third-party parser on foreign bytes raises anything; the user needs one line
        reason = " ".join(str(fault).split())[:160]
        raise checks.InputError(f"not a readable {suffix[1:]} mesh ({type(fault).__name__}: {reason})") from fault
    return Mesh(np.asarray(geometry.vertices), np.asarray(geometry.faces))


def _parse_obj(data: bytes) -> Mesh:
    """Positions and polygons of an OBJ file; polygons become fans; materials, normals and texture are not read."""
    vertices: list[list[bytes]] = []
    faces: list[tuple[int, int, int]] = []
    for number, line in enumerate(data.replace(b"\\\n", b" ").replace(b"\\\r\n", b" ").split(b"\n"), start=1):
        fields = line.split()
        if not fields:
            continue
        if fields[0] == b"v":
            if len(fields) < 4:
                raise checks.InputError(f"line {number}: a vertex needs three coordinates; got {len(fields) - 1}")
            vertices.append(fields[1:4])
        elif fields[0] == b"f":
            corners = [_obj_index(field, len(vertices), number) for field in fields[1:]]
            faces.extend((corners[0], corners[i], corners[i + 1]) for i in range(1, len(corners) - 1))
    try:
        positions = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    except ValueError as fault:
        raise checks.InputError(f"not a readable obj mesh ({fault})") from fault
    triangles = np.array(faces, dtype=np.int64).reshape(-1, 3)
    if len(triangles) and triangles.max() >= len(positions):
        raise checks.InputError(f"a face uses vertex {triangles.max() + 1}, but there are only {len(positions)}")
    return Mesh(positions, triangles)


def _obj_index(field: bytes, num_vertices: int, line: int) -> int:
    """Zero-based vertex of one face corner; negative indices count back from the last vertex read."""
    try:
        index = int(field.split(b"/", 1)[0])
    except ValueError as fault:
        raise checks.InputError(f"line {line}: face corner {field[:40]!r} is not an index") from fault
    zero_based = index - 1 if index > 0 else num_vertices + index
    if index == 0 or zero_based < 0:
        raise checks.InputError(f"line {line}: a face uses vertex {index}; indices start at 1")
    return zero_based


def _require_room(kind: str, claimed: int, least_bytes: int, data: bytes) -> None:
    if claimed < 0 or claimed * least_bytes > len(data):
        raise checks.InputError(f"the header claims {claimed} {kind}, but the file has only {len(data)} bytes")


def _check_off(data: bytes) -> None:
    text = re.sub(rb"#[^\n]*", b"", data)
    match = re.match(rb"\s*(?:ST|C|N|4)*OFF\s+(\d+)\s+(\d+)", text)
    if not match:
        raise checks.InputError("not an off mesh: no OFF header with counts")
    _require_room("vertices", int(match[1]), 6, data)
    _require_room("faces", int(match[2]), 8, data)
    rows = sum(1 for line in text[match.end() :].splitlines()[1:] if line.strip())
    if rows < int(match[1]) + int(match[2]):
        raise checks.InputError(
            f"cut short: {match[1].decode()} vertices and {match[2].decode()} faces, but {rows} rows"
        )


def _check_stl(data: bytes) -> None:
    if data[:5].lower() == b"solid" and b"facet" in data[:4096]:
        return
    if len(data) < 84:
        raise checks.InputError("not an stl mesh: shorter than its header")
    (claimed,) = struct.unpack("<I", data[80:84])
    _require_room("triangles", claimed, 50, data)


def _check_ply(data: bytes) -> None:
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise checks.InputError("not a ply mesh: no ply header")
    header = data[:end].decode("ascii", "replace").splitlines()
    ascii_format = any(line.split()[:2] == ["format", "ascii"] for line in header)
    name, count, row = "", 0, 0
    for words in [line.split() for line in header] + [["element", "", "0"]]:
        if words[:1] == ["element"] and len(words) == 3 and words[2].isdigit():
            _require_room(name or "elements", count, row, data)
            name, count, row = words[1], int(words[2]), 0
        elif words[:1] == ["element"]:
            raise checks.InputError(f"not a ply mesh: bad header line {' '.join(words)!r}")
        elif words[:1] == ["property"] and len(words) >= 3:
            row += 2 if ascii_format else _PLY_BYTES.get(words[2] if words[1] == "list" else words[1], 1)


def _check_glb(data: bytes) -> None:
    if len(data) < 20 or data[:4] != b"glTF":
        raise checks.InputError("not a glb mesh: no glTF header")
    (length,) = struct.unpack("<I", data[12:16])
    try:
        tree = json.loads(data[20 : 20 + length])
        counts = [int(accessor["count"]) for accessor in tree.get("accessors", [])]
        buffers = [buffer for buffer in tree.get("buffers", []) if "uri" in buffer]
    except (ValueError, KeyError, TypeError, AttributeError) as fault:
        raise checks.InputError("not a glb mesh: its JSON chunk cannot be read") from fault
    if buffers:
        raise checks.InputError("glb files must hold their own buffers; this one points outside itself")
    for count in counts:
        _require_room("accessor entries", count, 1, data)


def ply_bytes(mesh: Mesh, double: bool = False) -> bytes:
    """Binary little-endian PLY; float32 coordinates unless `double`."""
    scalar, name = ("<f8", "double") if double else ("<f4", "float")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
    header += "".join(f"property {name} {axis}\n" for axis in "xyz")
    header += f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, mesh.faces
    return header.encode() + mesh.vertices.astype(scalar).tobytes() + rows.tobytes()


def export_bytes(mesh: Mesh, suffix: str) -> bytes:
    """The mesh as a file of this suffix: PLY in float64, the other formats as trimesh writes them.

    Raises:
      InputError: a suffix that is not written.
    """
    suffix = suffix.lower()
    require_suffix(suffix)
    if suffix == ".ply":
        return ply_bytes(mesh, double=True)
    import trimesh

    plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    exported = plain.export(
        file_type=suffix[1:],
        **({"digits": 17} if suffix in (".obj", ".off") else {}),  # pyright: ignore[reportArgumentType]
    )
    return exported.encode() if isinstance(exported, str) else bytes(exported)

"""Triangle meshes in memory, and reading and writing them safely.

A file is judged before anything is allocated for it: its size, and the counts that its header claims against the bytes
that are there. Coordinates stay float64 and untouched (no welding, no reordering); scene graphs are flattened with
their transforms applied. `ddf.geometry.formats` holds the readers; trimesh writes the formats other than PLY.
"""

import json
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8

from ddf.core import checks, storage
from ddf.geometry.formats import ac3d, collada, gltf, obj, off, ply, stl, threemf

SUFFIXES = (".obj", ".ply", ".stl", ".off", ".glb")  # read and written
READ = (*SUFFIXES, ".gltf", ".dae", ".3mf", ".ac", ".acc")
MAX_FILE_BYTES = 256 << 20  # of meshes and clouds: three million triangles as text, ten million as numbers
_READERS = {
    ".obj": obj.parse,
    ".ply": ply.parse,
    ".stl": stl.parse,
    ".off": off.parse,
    ".glb": gltf.parse,
    ".dae": collada.parse,
    ".3mf": threemf.parse,
    ".ac": ac3d.parse,
    ".acc": ac3d.parse,
}
_Read = TypeVar("_Read")
_PLY_TYPES = {"<f4": "float", "<f8": "double", "u1": "uchar"}
_FLAT = 1e-14  # of the longest side squared
_HALF_STEP, _MOVED = 2.0**-24, 1e-6  # of float32 numbers; share of the diagonal
_NOT_BLANK = re.compile(rb"[^\0 \t\r\n]")


@dataclass(frozen=True)
class Mesh:
    """Vertices (float64) and triangles (indices into them), in one frame.

    remarks: what the reader of its file left out or could not take as it was, one line each. colours (sRGB) and unit
    normals of the vertices: PLY and GLB files keep them when they are written. InputError where a coordinate is not
    finite, or an index points at no vertex.
    """

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    remarks: tuple[str, ...] = ()
    colours: UInt8[np.ndarray, "n 3"] | None = None
    normals: Float[np.ndarray, "n 3"] | None = None

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.ascontiguousarray(self.faces, dtype=np.int64).reshape(-1, 3)
        checks.require_finite("vertices", vertices)
        if len(faces) and not (0 <= faces.min() and faces.max() < len(vertices)):
            bad = int(faces.min()) if faces.min() < 0 else int(faces.max())
            raise checks.InputError(f"faces must index the {len(vertices)} vertices; got index {bad}")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    def save(self, path: Path | str) -> None:
        """Write a .ply, .glb, .obj, .stl or .off file; InputError of another suffix."""
        with storage.naming(path):
            data = export_bytes(self, Path(path).suffix)
        storage.write_bytes(path, data)

    @property
    def triangles(self) -> Float[np.ndarray, "m 3 3"]:
        """Corner positions of every triangle."""
        return self.vertices[self.faces]

    def surface_vertices(self) -> Float[np.ndarray, "k 3"]:
        """The vertices of triangles with an area; of all triangles where none has one, all vertices without any."""
        faces = without_flat(self).faces
        return self.vertices[np.unique(faces)] if len(faces) else self.vertices

    def box(self) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Lower and upper corner of the box of `surface_vertices`."""
        used = self.surface_vertices()
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


def vertex_normals(mesh: Mesh) -> Float[np.ndarray, "n 3"]:
    """Unit normals of the vertices, by the areas of their triangles; 0 where these cancel or there are none."""
    normals, areas = face_normals(mesh)
    weighted = np.repeat(areas[:, None] * normals, 3, axis=0)
    total = np.stack([np.bincount(mesh.faces.ravel(), each, len(mesh.vertices)) for each in weighted.T], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(length > 0, length, 1.0)


def have_area(mesh: Mesh, areas: Float[np.ndarray, "m"]) -> Bool[np.ndarray, "m"]:
    """Which triangles have an area: a flatter one has no normal that float64 can give, and no ray meets it."""
    first, second, third = (mesh.vertices.take(mesh.faces[:, corner], axis=0) for corner in range(3))
    longest_sq = np.zeros(len(areas))
    for edge in (second - first, third - second, first - third):
        np.maximum(longest_sq, np.einsum("ij,ij->i", edge, edge), out=longest_sq)
    return areas > _FLAT * longest_sq


def without_flat(mesh: Mesh) -> Mesh:
    """Only the triangles with an area; the mesh as it is if none has one."""
    kept = have_area(mesh, face_normals(mesh)[1])
    return mesh if kept.all() or not kept.any() else Mesh(mesh.vertices, mesh.faces[kept], mesh.remarks)


def load(path: Path | str) -> Mesh:
    """Read OBJ, PLY, STL, OFF, GLB, glTF, DAE, 3MF or AC3D as one triangle mesh, in the file's own frame and order.

    Raises:
      FileNotFoundError: no such file.
      InputError: not a mesh file that can be read whole; the message names the file and the fault.
    """
    path = Path(path)
    return _read(path, f"mesh ({', '.join(READ)})", lambda data: parse(data, path.suffix.lower(), path.parent))


def _read(path: Path, kind: str, reader: Callable[[bytes], _Read]) -> _Read:
    """What a reader makes of a file; its complaints get the file's name."""
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    if not path.is_file():
        raise checks.InputError(f"{path}: not a file; give one {kind}")
    size = path.stat().st_size
    if size > MAX_FILE_BYTES:
        raise checks.InputError(f"{path}: {size} bytes; meshes and clouds must be at most {MAX_FILE_BYTES}")
    checks.require_content(path)
    try:
        return reader(path.read_bytes())
    except checks.InputError as fault:
        raise checks.InputError(f"{path}: {fault}") from fault


def load_surface(path: Path | str) -> Mesh:
    """As `load`, of a mesh that has a surface; InputError where no triangle has an area."""
    mesh = load(path)
    if not have_area(mesh, face_normals(mesh)[1]).any():
        raise checks.InputError(f"{path}: no triangle has an area")
    return mesh


def require_suffix(suffix: str, known: Sequence[str] = SUFFIXES) -> None:
    """Raise unless meshes with this suffix are written."""
    if suffix.lower() not in known:
        raise checks.InputError(f"mesh files must end in one of {', '.join(known)}; got {suffix or 'no suffix'}")


def parse(data: bytes, suffix: str, folder: Path | None = None) -> Mesh:
    """Read one mesh from the bytes of a file with this suffix; as `load`, whose errors here have no file's name. In
    the folder a .gltf finds its buffers.
    """
    require_suffix(suffix, READ)
    if not _NOT_BLANK.search(data):
        raise checks.InputError("the file is empty")
    try:
        read = gltf.parse(data, folder, as_text=True) if suffix == ".gltf" else _READERS[suffix](data)
        mesh = Mesh(read.vertices, read.faces, read.remarks)
    except MemoryError as fault:
        raise checks.InputError("the file holds more than memory does") from fault
    if len(mesh.faces) == 0:
        left_out = f" ({'; '.join(mesh.remarks)})" if mesh.remarks else ""
        raise checks.InputError(f"no triangles found: not a mesh, or an empty one{left_out}")
    return mesh


def ply_bytes(mesh: Mesh, double: bool = False) -> bytes:
    """Binary little-endian PLY; float32 coordinates unless `double`."""
    kind = "<f8" if double else "<f4"
    columns = {"x y z": (kind, mesh.vertices), "nx ny nz": (kind, mesh.normals), "red green blue": ("u1", mesh.colours)}
    rows = np.zeros(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, mesh.faces
    lists = f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\n"
    return _ply(columns, len(mesh.vertices), lists) + rows.tobytes()


def points_ply(points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"] | None = None) -> bytes:
    """A binary PLY of float64 vertices, with float32 normals (`nx`, `ny`, `nz`) if there are."""
    return _ply({"x y z": ("<f8", points), "nx ny nz": ("<f4", normals)}, len(points))


def _ply(columns: Mapping[str, tuple[str, np.ndarray | None]], count: int, after: str = "") -> bytes:
    """Header and vertices of a PLY file, of the properties that there are; `after`: the header's other elements."""
    there = {names: (kind, values) for names, (kind, values) in columns.items() if values is not None}
    table = np.zeros(count, dtype=[(names, kind, 3) for names, (kind, _) in there.items()])
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n"
    for names, (kind, values) in there.items():
        header += "".join(f"property {_PLY_TYPES[kind]} {name}\n" for name in names.split())
        table[names] = values
    return f"{header}{after}end_header\n".encode() + table.tobytes()


def told_origin(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"]:
    """What a file of float32 coordinates has them less, and tells: the middle of their box where float32 would move
    them by a millionth of its diagonal, else 0.
    """
    if not len(points) or np.abs(points).max() * _HALF_STEP <= _MOVED * np.linalg.norm(np.ptp(points, axis=0)):
        return np.zeros(3)
    return np.array([float(f"{each:.9g}") for each in points.min(axis=0) / 2 + points.max(axis=0) / 2])


def glb_bytes(mesh: Mesh) -> bytes:
    """Binary glTF 2.0, float32: positions, the mesh's normals and colours (linear), a rough material without metal.

    Far from 0 the node moves them to where they are.
    """
    origin = told_origin(mesh.vertices)
    columns = {"POSITION": (mesh.vertices - origin).astype("<f4")}
    if mesh.normals is not None:
        unit = np.where(mesh.normals.any(axis=1, keepdims=True), mesh.normals, [0.0, 0.0, 1.0])  # none may be 0
        columns["NORMAL"] = unit.astype("<f4")
    if mesh.colours is not None:
        share = mesh.colours / 255.0  # sRGB; IEC 61966-2-1
        linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
        columns["COLOR_0"] = linear.astype("<f4")
    parts, views, accessors = [*columns.values(), mesh.faces.astype("<u4").reshape(-1)], [], []
    for part in parts:
        start = sum(view["byteLength"] for view in views)
        target = 34962 if part.ndim == 2 else 34963  # vertices, indices
        views.append({"buffer": 0, "byteOffset": start, "byteLength": part.nbytes, "target": target})
        kind = {"componentType": 5126, "type": "VEC3"} if part.ndim == 2 else {"componentType": 5125, "type": "SCALAR"}
        accessors.append({"bufferView": len(accessors), "count": len(part), **kind})
    if len(mesh.vertices):
        accessors[0] |= {"min": parts[0].min(axis=0).tolist(), "max": parts[0].max(axis=0).tolist()}
    drawn = {"attributes": {name: i for i, name in enumerate(columns)}, "indices": len(columns), "material": 0}
    rough = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9}, "doubleSided": True}
    scene = {
        "asset": {"version": "2.0", "generator": "ddf"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **({"translation": origin.tolist()} if origin.any() else {})}],
        "meshes": [{"primitives": [drawn]}],
        "materials": [rough],
        "buffers": [{"byteLength": sum(part.nbytes for part in parts)}],
        "bufferViews": views,
        "accessors": accessors,
    }
    text, data = json.dumps(scene, separators=(",", ":")).encode(), b"".join(part.tobytes() for part in parts)
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def export_bytes(mesh: Mesh, suffix: str) -> bytes:
    """The mesh as a file of this suffix: PLY in float64, GLB and STL in float32 (see `told_origin`), text in full."""
    suffix = suffix.lower()
    require_suffix(suffix)
    if suffix == ".ply":
        return ply_bytes(mesh, double=True)
    if suffix == ".glb":
        return glb_bytes(mesh)
    import trimesh

    origin = told_origin(mesh.vertices) if suffix == ".stl" else np.zeros(3)
    plain = trimesh.Trimesh(mesh.vertices - origin, mesh.faces, process=False)
    exported = plain.export(
        file_type=suffix[1:],
        **({"digits": 17} if suffix in (".obj", ".off") else {}),  # pyright: ignore[reportArgumentType]
    )
    data = exported.encode() if isinstance(exported, str) else bytes(exported)
    return stl.with_origin(data, origin) if origin.any() else data


def read_points(path: Path | str) -> Float[np.ndarray, "n 3"]:
    """Vertices of a PLY cloud or mesh, float64, in the file's order; faces, colours and normals are not read.
    FileNotFoundError, or an InputError that names the file: no PLY that can be read whole, no vertices, one not finite.
    """
    return read_oriented(path)[0]


def read_oriented(path: Path | str) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"] | None]:
    """As `read_points`, and the normals as they stand in the file, None where it has none."""
    return _read(Path(path), "PLY cloud", ply.oriented)


def has_faces(path: Path | str) -> bool:
    """Whether a PLY file holds a mesh, and not a cloud alone."""
    elements = _read(Path(path), "PLY file", ply.header).elements
    return any(element.name in ("face", "tristrips") and element.count > 0 for element in elements)

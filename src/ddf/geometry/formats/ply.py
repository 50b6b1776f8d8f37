"""PLY, text and binary of both byte orders: its header, and the triangles or the points that it holds.

Our own reader: trimesh refuses lists of varying length, Open3D counts no words of a row, neither knows `tristrips`, and
both find `end_header` inside a comment.
"""

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry.formats import ply_header, ply_rows, raw, text

_LISTS = ("vertex_indices", "vertex_index")


def parse(data: bytes) -> raw.Raw:
    """Vertices and triangles of a PLY file: of polygons (`face`) and of triangle strips (`tristrips`).

    Raises:
      InputError: a header that cannot be read, rows that are missing, too many, too short or too long, indices to none.
    """
    wanted = {"vertex": ("x", "y", "z"), "face": _LISTS, "tristrips": _LISTS}
    found = _read(data, wanted)
    vertices = _positions(found)
    sizes, corners = _list(found, "face")
    mesh = raw.of_polygons(vertices, sizes, corners)
    strips, along = _list(found, "tristrips")
    if len(strips) == 0:
        return mesh
    both = raw.of_polygons(vertices, np.full(0, 3), np.zeros(0, dtype=np.int64))
    faces = _of_strips(strips, along)
    if len(faces) and not (0 <= faces.min() and faces.max() < len(vertices)):
        raise checks.InputError(f"a triangle strip uses vertex {faces.max()}, but there are only {len(vertices)}")
    return raw.Raw(both.vertices, np.concatenate([mesh.faces, faces]), mesh.remarks)


def points(data: bytes) -> Float[np.ndarray, "n 3"]:
    """Vertices of a PLY cloud or mesh.

    Raises:
      InputError: as `parse`; the file has no points.
    """
    vertices = _positions(_read(data, {"vertex": ("x", "y", "z")}))
    if len(vertices) == 0:
        raise checks.InputError("the cloud has no points")
    return vertices


def _read(data: bytes, wanted: ply_rows.Wanted) -> ply_rows.Found:
    data = text.decoded(data)
    header = ply_header.parse(data)
    _check_vertices(header)
    body = data[header.size :]
    if header.form == "ascii":
        return ply_rows.from_text(body, header.elements, wanted, header.num_lines)
    return ply_rows.from_bytes(body, header.elements, wanted, ">" if header.form == "binary_big_endian" else "<")


def _check_vertices(header: ply_header.Header) -> None:
    own = next((element.properties for element in header.elements if element.name == "vertex"), None)
    if own is None:
        raise checks.InputError("a PLY file must have an 'element vertex <count>'; this one has none")
    raw.require_few_vertices(next(element.count for element in header.elements if element.name == "vertex"))
    axes = [p for p in own if p.name in ("x", "y", "z")]
    if any(p.length for p in axes):
        raise checks.InputError("x, y and z of the vertices of a PLY file must be plain number properties, not lists")
    if len(axes) < 3:
        names = ", ".join(p.name[:20] for p in own[:20])
        raise checks.InputError(f"the vertices of a PLY file must have x, y and z; got {names or 'nothing'}")


def _positions(found: ply_rows.Found) -> Float[np.ndarray, "n 3"]:
    return np.stack([raw.widened(np.asarray(found["vertex"][axis])) for axis in "xyz"], axis=1)


def _list(found: ply_rows.Found, element: str) -> tuple[np.ndarray, np.ndarray]:
    """Lengths and values of the element's list of vertices; none where it has no such element."""
    nothing = np.zeros(0, dtype=np.int64)
    own = found.get(element)
    if own is None:
        return nothing, nothing
    lists = [values for values in own.values() if isinstance(values, tuple)]
    if len(lists) != 1:
        raise checks.InputError(f"element {element} must have one list vertex_indices; got {len(lists)}")
    sizes, values = lists[0]
    if values.dtype.kind == "f":
        raise checks.InputError(f"the list vertex_indices of element {element} must hold whole numbers, not floats")
    raw.require_few_corners(len(values))
    return sizes.astype(np.int64, copy=False), values.astype(np.int64, copy=False)


def _of_strips(sizes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Triangles of strips, every second one turned; -1 ends a strip inside a row."""
    ends = np.zeros(len(values), dtype=bool)
    ends[np.cumsum(sizes[sizes > 0])[:-1]] = True
    label = np.cumsum(ends | (values == -1))  # strips by number; a -1 opens one and is no part of it
    keep = values != -1
    label, values = label[keep], values[keep]
    if len(values) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    first = np.flatnonzero(np.diff(label, prepend=-1))
    place = np.arange(len(values)) - np.repeat(first, np.diff(first, append=len(values)))
    start = np.flatnonzero(label[2:] == label[:-2])
    faces = np.stack([values[start], values[start + 1], values[start + 2]], axis=1)
    odd = place[start] % 2 == 1
    faces[odd] = faces[odd][:, [1, 0, 2]]
    return faces

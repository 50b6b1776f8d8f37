"""Wavefront OBJ: vertices and polygons; groups, smoothing, materials, texture, normals, lines and points are not read.

Our own reader: libraries split vertices at texture seams, weld or reorder them, and shift indices after a bad line.
"""

import re
from array import array
from collections.abc import Iterator

from ddf.core import checks
from ddf.geometry.formats import raw, text

MAX_FACES = 8_000_000
_LOST = re.compile(rb"[vVfF][^a-zA-Z]")  # v1, or v with a space that is not ASCII's
_SURFACES = (b"surf", b"curv", b"curv2")


def parse(data: bytes) -> raw.Raw:
    """Vertices in float64 and triangles of an OBJ file.

    Raises:
      InputError: a line that cannot be read, by number; an index to no vertex; no text; more than 8 million faces.
    """
    vertices, corners, counts = array("d"), array("q"), array("q")
    data, curved = text.decoded(data), 0
    num_faces = data.count(b"\nf")
    if num_faces > MAX_FACES:
        raise checks.InputError(f"the file has {num_faces} faces; at most {MAX_FACES} are read")
    exact = b"_" in data  # Python takes 1_0 for 10
    for number, fields in _statements(data):
        keyword = fields[0]
        if keyword == b"v":
            if len(fields) < 4:
                raise checks.InputError(f"line {number}: a vertex needs three coordinates; got {len(fields) - 1}")
            vertices.extend(_coordinates(fields[1:4], exact, number))
        elif keyword in (b"f", b"fo"):
            corners.extend(_index(field, len(vertices) // 3, number) for field in fields[1:])
            counts.append(len(fields) - 1)
        else:
            curved += keyword in _SURFACES
            if _LOST.match(keyword):
                raise checks.InputError(
                    f"line {number}: {text.shown(keyword)} is no statement, a vertex or face is lost"
                )
    remarks = (f"{curved} free-form curves and surfaces are left out",) if curved else ()
    return raw.of_polygons(vertices, counts, corners, remarks)


def _statements(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Line number and words of every statement: no comments, lines that end in a backslash joined with the next.

    A backslash inside a comment continues nothing.
    """
    commented, continued = b"#" in data, b"\\" in data
    held: list[bytes] = []
    number = 0
    for number, line in text.lines(data):
        if commented:
            line = line.partition(b"#")[0]
        if continued and line.rstrip().endswith(b"\\"):
            held = _joined(held, line.rstrip()[:-1].split(), number)
            continue
        fields = line.split()
        if held:
            fields, held = _joined(held, fields, number), []
        if fields:
            if fields[0] in (b"V", b"F", b"FO"):
                fields[0] = fields[0].lower()
            yield number, fields
    if held:
        yield number, held


def _joined(held: list[bytes], more: list[bytes], number: int) -> list[bytes]:
    if held and more and more[0] in (b"v", b"f"):
        raise checks.InputError(
            f"line {number}: the line before ends in a backslash, so {text.shown(more[0])} would be lost; remove it"
        )
    return held + more


def _coordinates(fields: list[bytes], exact: bool, line: int) -> list[float]:
    try:
        if not exact:
            return [float(field) for field in fields]
    except ValueError:
        pass
    return [text.number(field, f"not a readable obj mesh, line {line}") for field in fields]


def _index(field: bytes, num_vertices: int, line: int) -> int:
    """Zero-based vertex of one face corner; negative indices count back from the last vertex read."""
    try:
        index = int(field.split(b"/", 1)[0])
    except ValueError as fault:
        raise checks.InputError(f"line {line}: face corner {text.shown(field)} is not an index") from fault
    zero_based = index - 1 if index > 0 else num_vertices + index
    if index == 0 or zero_based < 0:
        raise checks.InputError(f"line {line}: a face uses vertex {index}; indices start at 1")
    if index > 1 << 40 or b"_" in field:
        raise checks.InputError(f"line {line}: face corner {text.shown(field)} is not an index")
    return zero_based

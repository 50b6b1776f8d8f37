"""Geomview OFF: header with counts, a row per vertex, a row per polygon.

Our own reader: trimesh refuses faces of several sizes and reads files that are cut short; Open3D reads no other header.
"""

import re
from array import array
from collections.abc import Iterator

from ddf.core import checks
from ddf.geometry.formats import raw, text

_HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF(.*)", re.IGNORECASE | re.DOTALL)


def parse(data: bytes) -> raw.Raw:
    """Vertices and triangles of an OFF file; colours, normals and texture coordinates are not read.

    Raises:
      InputError: no header with counts, binary or four-dimensional OFF, rows that are missing, too many or unreadable.
    """
    rows = _rows(text.decoded(data))
    num_vertices, num_faces = _counts(rows, len(data))
    vertices, corners, counts = array("d"), array("q"), array("q")
    for number, words in _take(rows, num_vertices, num_vertices, num_faces, 0):
        if len(words) < 3:
            raise checks.InputError(f"line {number}: a vertex needs three coordinates; got {len(words)}")
        vertices.extend(text.number(word, f"line {number}") for word in words[:3])
    for number, words in _take(rows, num_faces, num_vertices, num_faces, num_vertices):
        size = text.whole(words[0], f"line {number}")
        if not 0 <= size < len(words):
            raise checks.InputError(f"line {number}: a face of {size} corners, but {len(words) - 1} numbers follow")
        corners.extend(text.whole(word, f"line {number}") for word in words[1 : 1 + size])
        counts.append(size)
    more = sum(1 for _ in rows)
    if more:
        raise checks.InputError(f"the header claims {num_vertices} vertices and {num_faces} faces; {more} rows follow")
    return raw.of_polygons(vertices, counts, corners)


def _rows(data: bytes) -> Iterator[tuple[int, list[bytes]]]:
    for number, line in text.lines(data):
        words = line.partition(b"#")[0].split()
        if words:
            yield number, words


def _counts(rows: Iterator[tuple[int, list[bytes]]], size: int) -> tuple[int, int]:
    """Vertices and faces, from the header's line (glued to the keyword or not) or the one after it."""
    number, words = next(rows, (0, [b""]))
    match = _HEADER.fullmatch(words[0])
    if not match:
        raise checks.InputError("not an off mesh: no OFF header with counts")
    if match[4] or match[5]:
        raise checks.InputError(f"{text.shown(words[0])}: vertices with four or n coordinates are not read")
    if words[1:2] and words[1].upper() == b"BINARY":
        raise checks.InputError("binary OFF is not read; save it as text")
    words = [match[6], *words[1:]] if match[6] else words[1:]
    if not words:
        number, words = next(rows, (0, []))
    if not 2 <= len(words) <= 3 or not all(word.isdigit() and len(word) < 20 for word in words):
        raise checks.InputError(f"not an off mesh: no OFF header with counts (line {number})")
    num_vertices, num_faces = int(words[0]), int(words[1])
    raw.require_room("vertices", num_vertices, 6, size)
    raw.require_room("faces", num_faces, 2, size)
    return num_vertices, num_faces


def _take(
    rows: Iterator[tuple[int, list[bytes]]], count: int, num_vertices: int, num_faces: int, before: int
) -> Iterator[tuple[int, list[bytes]]]:
    for i in range(count):
        row = next(rows, None)
        if row is None:
            raise checks.InputError(f"cut short: {num_vertices} vertices and {num_faces} faces, but {before + i} rows")
        yield row

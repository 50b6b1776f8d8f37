"""Geomview OFF: header with counts, a row per vertex, a row per polygon.

Our own reader: trimesh refuses faces of several sizes and reads files that are cut short; Open3D reads no other header.
"""

import re
from array import array
from collections.abc import Iterator

import numpy as np

from ddf.core import checks
from ddf.geometry.formats import raw, text

_HEADER = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF(.*)", re.IGNORECASE | re.DOTALL)
_HEADER_LINES = 100_000  # comments among them


def parse(data: bytes) -> raw.Raw:
    """Vertices and triangles of an OFF file; colours, normals and texture coordinates are not read.

    Raises:
      InputError: no header with counts, binary or four-dimensional OFF, rows that are missing, too many or unreadable.
    """
    blocks = text.Blocks(text.decoded(data))
    num_vertices, num_faces = _counts(_header_rows(blocks), len(data))
    vertices, corners, counts, read = array("d"), array("q"), array("q"), 0
    while read < num_vertices + num_faces:
        is_vertex = read < num_vertices
        block = blocks.next((num_vertices if is_vertex else num_vertices + num_faces) - read)
        if block is None:
            raise checks.InputError(f"cut short: {num_vertices} vertices and {num_faces} faces, but {read} rows")
        values, sizes = _table(blocks, block, is_vertex)
        read += len(sizes)
        if is_vertex:
            vertices.frombytes(values.tobytes())
        else:
            firsts = np.cumsum(sizes) - sizes
            corners.frombytes(np.delete(values, firsts).tobytes())
            counts.frombytes((sizes - 1).tobytes())
    more = 0
    while block := blocks.next():
        more += sum(1 for _ in _rows(blocks.lines(block)))
    if more:
        raise checks.InputError(f"the header claims {num_vertices} vertices and {num_faces} faces; {more} rows follow")
    return raw.of_polygons(vertices, counts, corners)


def _header_rows(blocks: text.Blocks) -> Iterator[tuple[int, list[bytes]]]:
    """Rows of the first lines, one at a time: the others stay where they are."""
    for _ in range(_HEADER_LINES):
        block = blocks.next(1)
        if block is None:
            return
        yield from _rows(blocks.lines(block))


def _rows(lines: Iterator[tuple[int, bytes]]) -> Iterator[tuple[int, list[bytes]]]:
    for number, line in lines:
        words = line.partition(b"#")[0].split()
        if words:
            yield number, words


def _table(blocks: text.Blocks, block: text.Block, is_vertex: bool) -> text.Table:
    """The numbers of the rows that count: three of a vertex; of a face how many corners, and these."""
    table = blocks.table(block.data, whole=not is_vertex)
    if table is not None:
        words = table.counts[table.counts > 0]
        starts = np.cumsum(words) - words
        sizes = np.full(len(words), 3) if is_vertex else table.values[starts] + 1
        if ((sizes > 0) & (sizes <= words)).all():
            place = np.arange(len(table.values)) - np.repeat(starts, words)
            return text.Table(table.values[place < np.repeat(sizes, words)], sizes)
    values, counts = array("d" if is_vertex else "q"), array("q")
    for number, words in _rows(blocks.lines(block)):
        where = f"line {number}"
        size = 3 if is_vertex else text.whole(words[0], where) + 1
        if is_vertex and len(words) < 3:
            raise checks.InputError(f"{where}: a vertex needs three coordinates; got {len(words)}")
        if not 0 < size <= len(words):
            raise checks.InputError(f"{where}: a face of {size - 1} corners, but {len(words) - 1} numbers follow")
        values.extend((text.number if is_vertex else text.whole)(word, where) for word in words[:size])
        counts.append(size)
    return text.Table(np.asarray(values), np.asarray(counts).view(np.int64))


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

"""Wavefront OBJ: vertices and polygons; groups, smoothing, materials, texture, normals, lines and points are not read.

Our own reader: libraries split vertices at texture seams, weld or reorder them, and shift indices after a bad line.
"""

import itertools
import re
from array import array
from collections.abc import Iterator

import numpy as np

from ddf.core import checks
from ddf.geometry.formats import raw, text

MAX_FACES = 8_000_000
_LOST = re.compile(rb"[vVfF][^a-zA-Z]")  # v1, or v with a space that is not ASCII's
_SURFACES = (b"surf", b"curv", b"curv2")
_CONTINUED = re.compile(rb"\\[ \t\v\f]*\n")
_ODD = re.compile(rb"^[ \t]*(?:v(?![ \t]|[nt][ \t])|f(?![ \t])|[VFcC\v\f]|su)", re.MULTILINE)  # read word by word
_TAIL, _TAIL_ALONE = re.compile(rb"/\S*"), re.compile(rb"\s/")  # texture and normal of a corner
_LARGEST = 1 << 40  # of an index


def parse(data: bytes) -> raw.Raw:
    """Vertices in float64 and triangles of an OBJ file."""
    data = text.decoded(data)
    _require_few(data.count(b"\nf"))
    blocks, reading = text.Blocks(data), _Reading()
    while block := blocks.next():
        _require_few(len(reading.counts))
        if not reading.at_once(blocks, block.data):
            reading.by_word(blocks, block)
    told = {f"{reading.curved} free-form curves and surfaces are left out": reading.curved}
    told[f"the fourth coordinate of {reading.weighted} vertices is not used"] = reading.weighted
    remarks = tuple(remark for remark, count in told.items() if count)
    return raw.of_polygons(reading.vertices, reading.counts, reading.corners, remarks)


def _require_few(num_faces: int) -> None:
    if num_faces > MAX_FACES:
        raise checks.InputError(f"the file has {num_faces} faces; at most {MAX_FACES} are read")


class _Reading:
    """What was read so far: coordinates, corners of each polygon and their vertices from 0; free forms left out and
    weights of vertices that are not 1.
    """

    def __init__(self) -> None:
        self.vertices, self.corners, self.counts, self.curved = array("d"), array("q"), array("q"), 0
        self.weighted = 0

    def at_once(self, blocks: text.Blocks, block: bytes) -> bool:
        """Read a block of plain lines; False, and nothing is read, if one of them is of another form or at fault."""
        if _CONTINUED.search(block) or _ODD.search(block):
            return False
        lines = [line.lstrip() for line in block.split(b"\n")]
        heads = np.array([line[:2] for line in lines])
        is_place, is_face = (np.isin(heads, (letter + b" ", letter + b"\t")) for letter in (b"v", b"f"))
        places, faces = (
            b"\n".join(line[1:] for line in itertools.compress(lines, kept)) for kept in (is_place, is_face)
        )
        positions, corners = blocks.table(places), blocks.table(_TAIL.sub(b"", faces), whole=True)
        if positions is None or corners is None or _TAIL_ALONE.search(faces):
            return False
        before = (len(self.vertices) // 3 + np.cumsum(is_place))[is_face]
        sizes, counts = positions.counts[: is_place.sum()], corners.counts[: len(before)]
        index = np.where(corners.values > 0, corners.values - 1, corners.values + np.repeat(before, counts))
        if (sizes < 3).any() or (corners.values == 0).any():
            return False
        if len(index) and (index.min() < 0 or corners.values.max() > _LARGEST):
            return False
        starts = np.cumsum(sizes) - sizes
        self.vertices.frombytes(positions.values[starts[:, None] + np.arange(3)].tobytes())
        self.weighted += int((positions.values[starts[sizes == 4] + 3] != 1.0).sum())
        self.corners.frombytes(index.tobytes())
        self.counts.frombytes(counts.tobytes())
        return True

    def by_word(self, blocks: text.Blocks, block: text.Block) -> None:
        for number, fields in _statements(blocks.lines(block), b"#" in block.data, b"\\" in block.data):
            keyword = fields[0]
            if keyword == b"v":
                if len(fields) < 4:
                    raise checks.InputError(f"line {number}: a vertex needs three coordinates; got {len(fields) - 1}")
                self.vertices.extend(text.number(w, f"not a readable obj mesh, line {number}") for w in fields[1:4])
                self.weighted += len(fields) == 5 and text.number(fields[4], f"line {number}") != 1.0
            elif keyword in (b"f", b"fo"):
                self.corners.extend(_index(field, len(self.vertices) // 3, number) for field in fields[1:])
                self.counts.append(len(fields) - 1)
            else:
                self.curved += keyword in _SURFACES
                if _LOST.match(keyword):
                    raise checks.InputError(
                        f"line {number}: {text.shown(keyword)} is no statement, a vertex or face is lost"
                    )


def _statements(
    lines: Iterator[tuple[int, bytes]], commented: bool, continued: bool
) -> Iterator[tuple[int, list[bytes]]]:
    """Line number and words of every statement: no comments, lines that end in a backslash joined with the next.

    A backslash inside a comment continues nothing.
    """
    held: list[bytes] = []
    number = 0
    for number, line in lines:
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


def _index(field: bytes, num_vertices: int, line: int) -> int:
    """Zero-based vertex of one face corner; negative indices count back from the last vertex read."""
    try:
        index = int(field.split(b"/", 1)[0])
    except ValueError as fault:
        raise checks.InputError(f"line {line}: face corner {text.shown(field)} is not an index") from fault
    zero_based = index - 1 if index > 0 else num_vertices + index
    if index == 0 or zero_based < 0:
        raise checks.InputError(f"line {line}: a face uses vertex {index}; indices start at 1")
    if index > _LARGEST or b"_" in field:
        raise checks.InputError(f"line {line}: face corner {text.shown(field)} is not an index")
    return zero_based

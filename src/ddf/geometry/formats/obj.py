"""Wavefront OBJ: vertices and polygons; groups, smoothing, materials, texture, normals, lines and points are not read.

Our own reader: libraries split vertices at texture seams, weld or reorder them, and shift indices after a bad line.
"""

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
_INDENTED = re.compile(rb"^[ \t]+", re.MULTILINE)
_BY_WORD = b"VFcC \t\v\f"  # lines that begin with one of these are read word by word, as those of `surf`
_FEED, _SPACE, _SLASH = 10, 32, 47
_LARGEST = 1 << 40  # of an index


def parse(data: bytes) -> raw.Raw:
    """Vertices in float64 and triangles of an OBJ file.

    Raises:
      InputError: a line that cannot be read, by number; an index to no vertex; no text; more than 8 million faces.
    """
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
        if _CONTINUED.search(block):
            return False
        block = (_INDENTED.sub(b"", block) if b"\n " in block or b"\n\t" in block else block) + b"\n  "
        octets = np.frombuffer(block, np.uint8).copy()
        ends = np.flatnonzero(octets == _FEED)
        begins = np.concatenate([[0], ends[:-1] + 1])
        first, second, third = (octets[begins + i] for i in range(3))
        blank, is_v = (second == _SPACE) | (second == ord("\t")), first == ord("v")
        named = is_v & ((second == ord("n")) | (second == ord("t"))) & ((third == _SPACE) | (third == ord("\t")))
        places, faces = is_v & blank, (first == ord("f")) & blank
        odd = ((is_v | (first == ord("f"))) & ~(places | faces | named)) | np.isin(first, np.frombuffer(_BY_WORD, "u1"))
        if (odd | ((first == ord("s")) & (second == ord("u")))).any():
            return False
        lengths = np.diff(ends, prepend=-1)
        octets[begins[places | faces]] = _SPACE
        octets = octets[: ends[-1] + 1]
        positions = blocks.table(octets[np.repeat(places, lengths)].tobytes())
        own = octets[np.repeat(faces, lengths)]
        if ((own[1:] == _SLASH) & (own[:-1] <= _SPACE)).any():
            return False
        corners = blocks.table(_without_tails(own), whole=True)
        if positions is None or corners is None or (positions.counts[: places.sum()] < 3).any():
            return False
        before = (len(self.vertices) // 3 + np.cumsum(places))[faces]
        counts = corners.counts[: len(before)]
        index = np.where(corners.values > 0, corners.values - 1, corners.values + np.repeat(before, counts))
        if len(index) and ((corners.values == 0).any() or index.min() < 0 or corners.values.max() > _LARGEST):
            return False
        starts = np.cumsum(positions.counts[: places.sum()]) - positions.counts[: places.sum()]
        self.vertices.frombytes(positions.values[starts[:, None] + np.arange(3)].tobytes())
        fourth = starts[positions.counts[: len(starts)] == 4] + 3
        self.weighted += int((positions.values[fourth] != 1.0).sum())
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


def _without_tails(octets: np.ndarray) -> bytes:
    """Lines of faces without what follows a slash in each corner: texture and normal."""
    slash = octets == _SLASH
    if not slash.any():
        return octets.tobytes()
    events = np.flatnonzero(slash | (octets <= _SPACE))
    tail = np.repeat(slash[events], np.diff(events, append=len(octets)))
    octets = octets.copy()
    octets[events[0] :][tail] = _SPACE
    return octets.tobytes()


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

"""STL, binary and text: told apart by the size that the count in bytes 80 to 83 asks for, then by content.

Our own reader: libraries tell the two apart by the word `solid` alone, and trust the count.
"""

import re
import struct
from array import array
from collections.abc import Iterator

import numpy as np

from ddf.core import checks
from ddf.geometry.formats import raw, text

_HEADER, _ROW = 84, 50
_OPEN = 1  # a facet without a vertex yet; then one more for each
_BETWEEN = re.compile(
    rb"(\A|endfacet\s*\n)(?:\s*(?:end)?solid\b(?![^\n]*facet)[^\n]*\n)+"
)  # lines of `solid`, in small letters
_CORNER = (b"vertex", b"", b"", b"")
_WORDS = (b"facet", b"normal", b"", b"", b"", b"outer", b"loop", *(3 * _CORNER), b"endloop", b"endfacet")
_NUMBERS = [i for i, word in enumerate(_WORDS) if not word][3:]  # places of the vertices' coordinates in a facet
_ORIGIN = re.compile(rb"ddf, coordinates less" + 3 * rb" (-?\d{1,9}(?:\.\d+)?(?:e[-+]\d+)?)")
_TEXT = re.compile(rb"\s*solid\b[^\0]*?(?:facet|endsolid)(?![^\0]{0,4096}\0)", re.I)  # however long the name


def parse(data: bytes) -> raw.Raw:
    """Three vertices for every triangle, as the file has them; normals and attributes are not read."""
    claimed = struct.unpack("<I", data[80:84])[0] if len(data) >= _HEADER else -1
    room, rest = divmod(len(data) - _HEADER, _ROW)
    if 0 <= claimed == room and (claimed > 0 or rest == 0):
        return _binary(data, claimed)
    words = text.decoded(data)
    if _TEXT.match(words):
        return _ascii(words)
    if claimed < 0:
        raise checks.InputError("not an stl mesh: shorter than its header")
    raise checks.InputError(f"the header claims {claimed} triangles, but the file has room for {room}")


def _binary(data: bytes, count: int) -> raw.Raw:
    row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    corners = np.frombuffer(data, row, count, _HEADER)["corners"]
    origin = [float(word) for word in found.groups()] if (found := _ORIGIN.match(data)) else 0.0
    return _soup(raw.widened(corners.reshape(-1, 3)) + origin)


def with_origin(data: bytes, origin: np.ndarray) -> bytes:
    """A binary file whose header tells what its coordinates are less, for `parse`."""
    told = "ddf, coordinates less {:.9g} {:.9g} {:.9g}".format(*origin).encode()
    return told.ljust(_HEADER - 4) + data[_HEADER - 4 :]


def _soup(vertices: np.ndarray) -> raw.Raw:
    raw.require_coordinates(vertices)
    return raw.Raw(vertices, np.arange(len(vertices)).reshape(-1, 3))


def _ascii(data: bytes) -> raw.Raw:
    blocks, reading, left, number = text.Blocks(data), _Reading(), b"", 1
    while block := blocks.next():
        found = left + block.data
        last = found.lower().rfind(b"endfacet")  # what follows is read with the next block
        end = found.find(b"\n", last) + 1 if last >= 0 else 0
        whole, left = (found[:end], found[end:]) if end else (found, b"")
        if not reading.at_once(whole):
            reading.by_word(blocks.lines(text.Block(number, whole)))
        number += whole.count(b"\n")
    reading.by_word(blocks.lines(text.Block(number, left)))
    if reading.in_facet or not reading.ended:
        whole, last = len(reading.vertices) // 9, blocks.data.rstrip().count(b"\n") + 1
        raise checks.InputError(f"cut short: {whole} whole triangles, then the file ends at line {last}")
    return _soup(np.asarray(reading.vertices, dtype=np.float64).reshape(-1, 3))


class _Reading:
    """What was read so far: coordinates, vertices of the facet that is open (and one), whether a solid has ended."""

    def __init__(self) -> None:
        self.vertices, self.in_facet, self.ended = array("d"), 0, False

    def at_once(self, data: bytes) -> bool:
        """Read whole facets of usual words; False, and nothing is read, if anything else is among them."""
        words = _BETWEEN.sub(rb"\1", data.lower()).split()
        facets, rest = divmod(len(words), len(_WORDS))
        if self.in_facet or rest or b"_" in b"".join(words):
            return False
        if any(word and words[i :: len(_WORDS)] != [word] * facets for i, word in enumerate(_WORDS)):
            return False
        try:
            corners = np.array([list(map(float, words[i :: len(_WORDS)])) for i in _NUMBERS])
        except ValueError:
            return False
        self.vertices.frombytes(corners.T.tobytes())
        self.ended = False
        return True

    def by_word(self, lines: Iterator[tuple[int, bytes]]) -> None:
        for number, line in lines:
            words = line.lower().split()
            if words[:1] in ([b"solid"], [b"endsolid"]):
                if self.in_facet:
                    raise checks.InputError(f"line {number}: {text.shown(words[0])} inside a facet")
                self.ended = words[0] == b"endsolid"
                words = words[words.index(b"facet") :] if b"facet" in words[1:] and b"vertex" in words else []
            self._read(words, number)

    def _read(self, words: list[bytes], number: int) -> None:
        i = 0
        while i < len(words):
            word, i = words[i], i + 1
            if word == b"vertex":
                if len(words) < i + 3:
                    raise checks.InputError(f"line {number}: a vertex needs three coordinates; got {len(words) - i}")
                self.vertices.extend(text.number(w, f"line {number}") for w in words[i : i + 3])
                i, self.in_facet = i + 3, self.in_facet + 1
            elif word == b"facet":
                if self.in_facet:
                    raise checks.InputError(f"line {number}: a facet begins inside another")
                self.in_facet, self.ended = _OPEN, False
                i += 4 if words[i : i + 1] == [b"normal"] else 0
            elif word == b"endfacet":
                if self.in_facet != _OPEN + 3:
                    got = max(self.in_facet - _OPEN, 0)
                    raise checks.InputError(f"line {number}: a facet needs three vertices; got {got}")
                self.in_facet = 0
            elif word == b"endsolid":
                self.ended, i = True, len(words)
            elif word not in (b"outer", b"loop", b"endloop"):
                raise checks.InputError(f"line {number}: {text.shown(word)} is no word of an STL file")

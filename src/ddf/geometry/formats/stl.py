"""STL, binary and text: told apart by the size that the count in bytes 80 to 83 asks for, then by content.

Our own reader: libraries tell the two apart by the word `solid` alone, and trust the count.
"""

import re
import struct
from array import array

import numpy as np

from ddf.core import checks
from ddf.geometry.formats import raw, text

_HEADER, _ROW = 84, 50
_TEXT = re.compile(rb"\s*solid\b", re.IGNORECASE)


def parse(data: bytes) -> raw.Raw:
    """Three vertices for every triangle, as the file has them; normals and attributes are not read.

    Raises:
      InputError: neither format; a count that disagrees with the size (both are named); a facet that is not whole.
    """
    claimed = struct.unpack("<I", data[80:84])[0] if len(data) >= _HEADER else -1
    room, rest = divmod(len(data) - _HEADER, _ROW)
    if claimed == room and (claimed > 0 or rest == 0):
        return _binary(data, claimed)
    words = text.decoded(data)
    if _TEXT.match(words) and b"\0" not in words[:4096] and re.search(rb"facet|endsolid", words[:4096], re.IGNORECASE):
        return _ascii(words)
    if claimed < 0:
        raise checks.InputError("not an stl mesh: shorter than its header")
    raise checks.InputError(f"the header claims {claimed} triangles, but the file has room for {room}")


def _binary(data: bytes, count: int) -> raw.Raw:
    row = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    corners = np.frombuffer(data, row, count, _HEADER)["corners"]
    return _soup(raw.widened(corners.reshape(-1, 3)))


def _soup(vertices: np.ndarray) -> raw.Raw:
    raw.require_coordinates(vertices)
    return raw.Raw(vertices, np.arange(len(vertices)).reshape(-1, 3))


def _ascii(data: bytes) -> raw.Raw:
    vertices, in_facet, number, ended = array("d"), 0, 0, False
    for number, line in text.lines(data):
        words = line.lower().split()
        if words[:1] in ([b"solid"], [b"endsolid"]):
            if in_facet:
                raise checks.InputError(f"line {number}: {text.shown(words[0])} inside a facet")
            ended = words[0] == b"endsolid"
            words = words[words.index(b"facet") :] if b"facet" in words[1:] and b"vertex" in words else []
        i = 0
        while i < len(words):
            word, i = words[i], i + 1
            if word == b"vertex":
                if len(words) < i + 3:
                    raise checks.InputError(f"line {number}: a vertex needs three coordinates; got {len(words) - i}")
                vertices.extend(text.number(w, f"line {number}") for w in words[i : i + 3])
                i, in_facet = i + 3, in_facet + 1
            elif word == b"facet":
                in_facet, ended = _begin(in_facet, number), False
                i += 4 if words[i : i + 1] == [b"normal"] else 0
            elif word == b"endfacet":
                in_facet = _end(in_facet, number)
            elif word == b"endsolid":
                ended, i = True, len(words)
            elif word not in (b"outer", b"loop", b"endloop"):
                raise checks.InputError(f"line {number}: {text.shown(word)} is no word of an STL file")
    if in_facet or not ended:
        raise checks.InputError(f"cut short: {len(vertices) // 9} whole triangles, then the file ends at line {number}")
    return _soup(np.array(vertices, dtype=np.float64).reshape(-1, 3))


_OPEN = 1  # a facet without a vertex yet; then one more for each


def _begin(in_facet: int, number: int) -> int:
    if in_facet:
        raise checks.InputError(f"line {number}: a facet begins inside another")
    return _OPEN


def _end(in_facet: int, number: int) -> int:
    if in_facet != _OPEN + 3:
        raise checks.InputError(f"line {number}: a facet needs three vertices; got {max(in_facet - _OPEN, 0)}")
    return 0

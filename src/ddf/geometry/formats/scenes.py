"""What files of scenes share: parts put in their places and joined, and XML read in one pass by expat.

A document type is refused, for its entities can grow without bound.
"""

import re
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.formats import raw, text

MAX_MARKS = 12_000_000  # line ends, entities and twice the tags: each calls a function of ours
MAX_ATTRIBUTES = 300_000  # of an element: they are held in memory together
MAX_BYTES = 128 << 20  # of text, after any decompression: some two million triangles
_PIECES = re.compile(rf"(?s).{{1,{1 << 20}}}\S*")  # whole words that are in memory at once
_UNREADABLE = (ElementTree.ParseError, ValueError, LookupError)
Part = tuple[Float[np.ndarray, "_ 3"], Int[np.ndarray, "_ 3"]]  # vertices and triangles


class Scene:
    """Placed parts, and what was left out, one remark each."""

    def __init__(self, most: int) -> None:
        self.remarks: dict[str, None] = {}
        self._most, self._parts, self._num_triangles = most, [], 0

    def require_room(self, num_triangles: int) -> None:
        """Raise if so many more are over 20 million."""
        self._num_triangles += num_triangles
        if self._num_triangles > raw.MAX_TRIANGLES:
            raise checks.InputError(f"the scene has more than {raw.MAX_TRIANGLES} triangles")

    def place(self, part: Part, matrix: Float[np.ndarray, "4 4"]) -> None:
        """Add the part moved by x -> M x; a mirroring transform turns its triangles, so that they face outwards."""
        vertices, faces = part
        if len(self._parts) >= self._most:
            raise checks.InputError(f"the scene places more than {self._most} parts")
        raw.require_coordinates(vertices)
        if not (matrix == np.eye(4)).all():
            with np.errstate(over="ignore", invalid="ignore"):  # `joined` refuses what is not finite
                vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
                faces = faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else faces
        self._parts.append((vertices, faces))

    def joined(self) -> raw.Raw:
        """All parts as one mesh, in their order."""
        offsets = np.cumsum([0, *(len(vertices) for vertices, _ in self._parts)])
        vertices = np.concatenate([np.zeros((0, 3)), *(vertices for vertices, _ in self._parts)])
        raw.require_coordinates(vertices)
        faces = [faces + offset for (_, faces), offset in zip(self._parts, offsets[:-1], strict=True)]
        return raw.Raw(vertices, np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces]), tuple(self.remarks))


def product(above: Float[np.ndarray, "4 4"], own: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    """Two transforms in a row; what is not finite is refused later, in one line."""
    with np.errstate(over="ignore", invalid="ignore"):
        return above @ own


def strip(index: Int[np.ndarray, "k"]) -> Int[np.ndarray, "m 3"]:
    """The triangles of a strip, every second one turned."""
    if len(index) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    first, second, third = index[:-2], index[1:-1], index[2:]
    odd = np.arange(len(first)) % 2 == 1
    return np.stack([first, np.where(odd, third, second), np.where(odd, second, third)], axis=1)


def numbers(values: Any, count: int, name: str) -> Float[np.ndarray, "k"]:
    """`count` finite numbers of at most 1e100, as a node gives them."""
    right = isinstance(values, list | tuple) and len(values) == count
    if not right or not all(isinstance(v, int | float) and abs(v) <= raw.LARGEST for v in values):
        raise checks.InputError(f"{name} of a node must be {count} finite numbers")
    return np.array(values, dtype=np.float64)


class Target:
    """Is told of what is read: `start`, `end`, `data` and the rest of `XMLParser`'s methods, those that it has.

    Tags and attributes in other namespaces as `{namespace}name`.
    """

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        """A document type, which is refused."""
        raise checks.InputError("the XML declares a document type, which is not read")


def read_xml(blocks: Iterator[bytes], target: Target) -> Any:
    """Tell a target of all that stands in an XML text; what it makes of that. InputError of what is no XML, cut short,
    more than 128 MiB, or has more elements, line ends or attributes than are read.
    """
    parser = ElementTree.XMLParser(target=target)
    total = marks = attributes = 0
    try:
        for data in blocks:
            total += len(data)
            if total > MAX_BYTES:
                raise checks.InputError(f"its XML has more than {MAX_BYTES} bytes")
            marks += data.count(b"\n") + data.count(b"\r") + data.count(b"&") + 2 * data.count(b"<")
            if marks > MAX_MARKS:
                raise checks.InputError("its XML has too many elements and line ends; save it in another format")
            before, _, tag = data.rpartition(b"<")
            attributes = tag.count(b"=") + (0 if before or tag != data else attributes)
            if attributes > MAX_ATTRIBUTES:
                raise checks.InputError("an element of its XML has too many attributes; save it in another format")
            parser.feed(data)
        return parser.close()
    except checks.InputError:
        raise
    except _UNREADABLE as fault:
        raise checks.InputError(f"not readable XML: {fault}") from fault


def decimals(words: str, where: str) -> Float[np.ndarray, "k"]:
    """The numbers of a text; `where` begins the complaint."""
    return _numbers(words, where, whole=False)


def indices(words: str, where: str) -> Int[np.ndarray, "k"]:
    """The whole numbers of a text, from 0 on; `where` begins the complaint."""
    found = _numbers(words, where, whole=True)
    if len(found) and found.min() < 0:
        raise checks.InputError(f"{where}: an index is {found.min()}; indices start at 0")
    return found


def _numbers(words: str, where: str, whole: bool) -> np.ndarray:
    """All numbers, in pieces that end between words: at once where all are plain, else word by word."""
    kind, read = (np.int64, text.whole) if whole else (np.float64, text.number)
    found = [np.zeros(0, dtype=kind)]
    for match in _PIECES.finditer(words):
        piece = match[0]
        table = text.Blocks(b"").table(piece.encode(), whole)
        if table is None:
            found.append(np.array([read(word.encode(), where) for word in piece.split()], dtype=kind))
            checks.require_finite(where, found[-1])
        else:
            found.append(table.values)
    return np.concatenate(found)

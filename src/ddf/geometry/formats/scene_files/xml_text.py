"""XML of mesh files, read in one pass by expat; a document type is refused, for its entities can grow without bound."""

import re
from collections.abc import Callable, Iterator
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.formats import text

MAX_MARKS = 12_000_000  # line ends, entities and twice the tags: each calls a function of ours
MAX_ATTRIBUTES = 300_000  # of an element: they are held in memory together
MAX_BYTES = 128 << 20  # of text, after any decompression: some two million triangles
_PIECE = 1 << 20  # characters whose words are in memory at once
_SPACE = re.compile(r"\s")


class Target:
    """Is told of everything that is read, and here looks at none of it.

    Tags and attributes in other namespaces as `{namespace}name`.
    """

    def start_ns(self, prefix: str, uri: str) -> None:
        """A namespace gets a prefix."""

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""

    def end(self, tag: str) -> None:
        """An element ends."""

    data: Callable[[str], None] | None = None
    """Text of an element, or a piece of it; None: text is passed over."""


class Reader:
    """A parser that is fed bytes and tells a target."""

    def __init__(self, target: Target) -> None:
        self._total = self._marks = self._attributes = 0
        self.start, self.end, self.start_ns = target.start, target.end, target.start_ns
        if target.data is not None:
            self.data = target.data
        self._parser = ElementTree.XMLParser(target=self)

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        """Called by the parser where a document type begins."""
        raise checks.InputError("the XML declares a document type, which is not read")

    def close(self) -> None:
        """Called by the parser at its end."""

    def feed(self, data: bytes) -> None:
        """The next bytes.

        Raises:
          InputError: no XML, or more than 128 MiB of it.
        """
        self._total += len(data)
        if self._total > MAX_BYTES:
            raise checks.InputError(f"its XML has more than {MAX_BYTES} bytes")
        self._marks += data.count(b"\n") + data.count(b"\r") + data.count(b"&") + 2 * data.count(b"<")
        if self._marks > MAX_MARKS:
            raise checks.InputError("its XML has too many elements and line ends; save it in another format")
        before, _, tag = data.rpartition(b"<")
        self._attributes = tag.count(b"=") + (0 if before or tag != data else self._attributes)
        if self._attributes > MAX_ATTRIBUTES:
            raise checks.InputError("an element of its XML has too many attributes; save it in another format")
        try:
            self._parser.feed(data)
        except (ElementTree.ParseError, ValueError, LookupError) as fault:
            raise _refused(fault) from fault

    def finish(self) -> None:
        """No more bytes follow.

        Raises:
          InputError: the XML is cut short.
        """
        try:
            self._parser.close()
        except (ElementTree.ParseError, ValueError, LookupError) as fault:
            raise _refused(fault) from fault


def _refused(fault: Exception) -> checks.InputError:
    return fault if isinstance(fault, checks.InputError) else checks.InputError(f"not readable XML: {fault}")


def numbers(words: str, where: str) -> Float[np.ndarray, "k"]:
    """The numbers of a text; `where` begins the complaint."""
    return np.concatenate([np.zeros(0), *(_numbers(piece, where) for piece in _pieces(words))])


def whole_numbers(words: str, where: str) -> Int[np.ndarray, "k"]:
    """The whole numbers of a text; `where` begins the complaint."""
    return np.concatenate([np.zeros(0, dtype=np.int64), *(_whole_numbers(piece, where) for piece in _pieces(words))])


def _whole_numbers(words: str, where: str) -> Int[np.ndarray, "k"]:
    table = text.Blocks(b"").table(words.encode(), whole=True)
    if table is not None:
        return table.values
    return np.array([text.whole(word.encode(), where) for word in words.split()], dtype=np.int64)


def _numbers(words: str, where: str) -> Float[np.ndarray, "k"]:
    try:
        if "_" not in words:  # Python takes 1_0 for 10
            return np.array(words.split(), dtype=np.float64)
    except ValueError:
        pass
    return np.array([text.number(word.encode(), where) for word in words.split()], dtype=np.float64)


def _pieces(words: str) -> Iterator[str]:
    """The text in pieces that end between words."""
    begin = 0
    while begin < len(words):
        space = _SPACE.search(words, begin + _PIECE)
        end = len(words) if space is None else space.end()
        yield words[begin:end]
        begin = end

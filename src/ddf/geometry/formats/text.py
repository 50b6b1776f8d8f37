"""Text of mesh files: byte order marks, encodings and line ends are settled here, once for all formats."""

import codecs
import io
import warnings
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ddf.core import checks

MAX_LINE = 16 << 20  # bytes; a polygon of a million corners fits
MAX_LINES = 12_000_000  # of a file: 1.7 million triangles of an STL file
MAX_NUMBERS = 60_000_000  # of a file
MAX_CONTINUED = 4 << 20  # bytes of one line after another that ends in a backslash
MAX_BY_WORD = 12_000_000  # words of a file that are read one by one, a line's end as four: about five seconds
_BLOCK = 1 << 19  # bytes
_FEED, _SPACE = 10, 32
_BLANK = b" \t\n\v\f"
_WHOLE, _DECIMAL = b"0123456789+-" + _BLANK, b"0123456789+-.eE" + _BLANK
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def decoded(data: bytes) -> bytes:
    """The same text without a byte order mark, in UTF-8 if it was UTF-16 or UTF-32; other bytes as they are. InputError
    names the encoding of a false mark.
    """
    if data.startswith(codecs.BOM_UTF8):
        return data[len(codecs.BOM_UTF8) :]
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), None)
    if encoding is None:
        return data
    try:
        return data.decode(encoding).encode("utf-8")
    except UnicodeError as fault:
        raise checks.InputError(f"the text is marked as {encoding.upper()} and is not; save it as UTF-8") from fault


class Block(NamedTuple):
    """Whole lines of a text, and the number of the first of them, from 1."""

    number: int
    data: bytes


class Table(NamedTuple):
    """All numbers of some lines, one after the other, and how many each line has."""

    values: np.ndarray
    counts: np.ndarray


class Blocks:
    """The lines of decoded text, a block at a time, none split from one that its last backslash continues.

    Lines end in LF, CR LF or CR. Most blocks are read at once (`table`); those that need it, word by word (`lines`).

    Raises:
      InputError: zero bytes (no text file has them), a line longer than 16 MiB, or more than 12 million lines; while
        reading, more than 60 million numbers, or more than 12 million words one by one.
    """

    def __init__(self, data: bytes, number: int = 1) -> None:
        if b"\0" in data:
            where = data.index(0)
            raise checks.InputError(f"a zero byte at {where}: not a text file, or one in an encoding without mark")
        if b"\r" in data:
            data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        num_lines = data.count(b"\n")
        if num_lines > MAX_LINES:
            raise checks.InputError(f"the text has {num_lines} lines; at most {MAX_LINES} are read")
        self.data, self._place, self._number = data, 0, number
        self._numbers = self._by_word = 0

    def next(self, most_lines: int = MAX_LINES) -> Block | None:
        """The next lines, at most so many; None at the end of the text."""
        data, begin = self.data, self._place
        if begin >= len(data) or most_lines <= 0:
            return None
        end = self._end_of_line(begin if most_lines == 1 else min(begin + _BLOCK, len(data)) - 1)
        least = end
        while _goes_on(data, begin, end):
            end = self._end_of_line(end)
            if end - least > MAX_CONTINUED:
                raise checks.InputError(f"more than {MAX_CONTINUED} bytes of lines that end in backslashes")
        if data.count(b"\n", begin, end) >= most_lines:
            ends = np.flatnonzero(np.frombuffer(data, np.uint8, end - begin, begin) == _FEED)
            end = begin + int(ends[most_lines - 1]) + 1
        found = Block(self._number, data[begin:end])
        self._place, self._number = end, self._number + found.data.count(b"\n")
        return found

    def _end_of_line(self, place: int) -> int:
        """The place after the line that `place` lies in."""
        feed = self.data.find(b"\n", place, place + MAX_LINE)
        if feed < 0 and place + MAX_LINE < len(self.data):
            raise checks.InputError(f"a line is longer than {MAX_LINE} bytes")
        return feed + 1 if feed >= 0 else len(self.data)

    def lines(self, block: Block) -> Iterator[tuple[int, bytes]]:
        """Number and content of every line of a block that is read word by word."""
        data = block.data
        self._by_word += sum(data.count(blank) for blank in (b" ", b"\t", b"\v", b"\f")) + 4 * data.count(b"\n")
        if self._by_word > MAX_BY_WORD:
            raise checks.InputError("too many rows are of an unusual form (words or numbers); save it in a plain one")
        return enumerate(io.BytesIO(block.data), block.number)

    def table(self, data: bytes, whole: bool = False) -> Table | None:
        """The numbers of some lines, all of them at once; None where a word is no plain number. They are float64,
        rounded as Python rounds, or int64 if `whole`.
        """
        if data.translate(None, _WHOLE if whole else _DECIMAL):
            return None
        if not data.endswith(b"\n"):
            data += b"\n"
        octets = np.frombuffer(data, np.uint8)
        in_word = octets > _SPACE
        begins = in_word.copy()
        begins[1:] &= ~in_word[:-1]
        first = np.concatenate([[0], np.flatnonzero(octets == _FEED)[:-1] + 1])
        counts = np.add.reduceat(begins.view(np.int8), first, dtype=np.int64)
        total = int(counts.sum())
        self._numbers += total
        if self._numbers > MAX_NUMBERS:
            raise checks.InputError(f"the text has more than {MAX_NUMBERS} numbers")
        if total == 0:
            return Table(np.zeros(0, dtype=np.int64 if whole else np.float64), counts)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", DeprecationWarning)  # numpy's word for a text that ends early
                values = np.fromstring(data, np.int64 if whole else np.float64, sep=" ")
        except (DeprecationWarning, ValueError):
            return None
        return Table(values, counts) if len(values) == total else None


def _goes_on(data: bytes, begin: int, end: int) -> bool:
    """Whether the last line before `end` ends in a backslash, and another follows."""
    return end < len(data) and data[data.rfind(b"\n", begin, end - 1) + 1 : end].rstrip().endswith(b"\\")


def number(word: bytes, where: str) -> float:
    """A decimal number; `where` begins the complaint."""
    try:
        if b"_" in word:
            raise ValueError
        return float(word)
    except ValueError as fault:
        raise checks.InputError(f"{where}: {shown(word)} is not a number") from fault


def whole(word: bytes, where: str) -> int:
    """A whole number; `where` begins the complaint."""
    try:
        if b"_" in word or len(word) > 18:
            raise ValueError
        return int(word)
    except ValueError as fault:
        raise checks.InputError(f"{where}: {shown(word)} is not a whole number") from fault


def shown(word: bytes) -> str:
    """A word of a file as a complaint shows it: short and printable."""
    return ascii(word[:40].decode("utf-8", "replace"))

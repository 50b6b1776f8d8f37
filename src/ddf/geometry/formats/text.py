"""Text of mesh files: byte order marks, encodings and line ends are settled here, once for all formats."""

import codecs
import io
from collections.abc import Iterator

from ddf.core import checks

MAX_LINE = 16 << 20  # bytes; a polygon of a million corners fits
MAX_LINES = 16_000_000  # of a file: two million triangles of an STL file
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def decoded(data: bytes) -> bytes:
    """The same text without a byte order mark, in UTF-8 if it was UTF-16 or UTF-32; other bytes as they are.

    Raises:
      InputError: a mark of UTF-16 or UTF-32, but what follows is not; the encoding is named.
    """
    if data.startswith(codecs.BOM_UTF8):
        return data[len(codecs.BOM_UTF8) :]
    encoding = next((name for mark, name in _MARKS if data.startswith(mark)), None) or _unmarked(data)
    if encoding is None:
        return data
    try:
        return data.decode(encoding).encode("utf-8")
    except UnicodeError as fault:
        raise checks.InputError(f"the text is marked as {encoding.upper()} and is not; save it as UTF-8") from fault


def _unmarked(data: bytes) -> str | None:
    """UTF-16 without a mark: in plain text every second byte is zero, and no other."""
    head = data[: min(len(data), 4096) // 2 * 2]
    even, odd = head[::2], head[1::2]
    if len(head) >= 8 and not any(odd) and all(even):
        return "utf-16-le"
    return "utf-16-be" if len(head) >= 8 and not any(even) and all(odd) else None


def lines(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Number (from 1) and content of every line of decoded text; lines end in LF, CR LF or CR.

    Raises:
      InputError: zero bytes (no text file has them), a line longer than 16 MiB, or more than 16 million lines.
    """
    if b"\0" in data:
        raise checks.InputError(f"a zero byte at {data.index(0)}: not a text file, or one in an encoding without mark")
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    num_lines = data.count(b"\n")
    if num_lines > MAX_LINES:
        raise checks.InputError(f"the text has {num_lines} lines; at most {MAX_LINES} are read")
    stream, number = io.BytesIO(data), 0
    while line := stream.readline(MAX_LINE):
        number += 1
        if len(line) == MAX_LINE:
            raise checks.InputError(f"line {number} is longer than {MAX_LINE} bytes")
        yield number, line


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

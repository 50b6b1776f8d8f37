"""The rows of a PLY file, text or binary; only the properties asked for are kept."""

from array import array
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ddf.core import checks
from ddf.geometry.formats import raw, text
from ddf.geometry.formats.ply_header import Element, Property

MAX_UNEVEN = 8_000_000  # rows whose lists differ in length: four seconds
_ROWS = 1 << 18
Wanted = Mapping[str, Sequence[str]]
Columns = dict[str, np.ndarray | tuple[np.ndarray, np.ndarray]]
Found = dict[str, Columns]
"""By element and property: a value per row; of lists their lengths, and all values one after the other."""


def from_text(body: bytes, elements: list[Element], wanted: Wanted, header_lines: int) -> Found:
    """Rows of a text body: one a line, as many words as declared. Blank lines are passed over."""
    blocks = text.Blocks(body, header_lines + 1)
    found: Found = {}
    for element in elements:
        columns = _text_columns(element, wanted.get(element.name, ()), blocks)
        if element.name in wanted:
            found[element.name] = columns
    while block := blocks.next():
        for number, line in blocks.lines(block):
            if line.split():
                raise checks.InputError(f"line {number}: rows follow that the header does not declare")
    return found


def _text_columns(element: Element, names: Sequence[str], blocks: text.Blocks) -> Columns:
    kept = _Kept(element, names)
    read, count = 0, element.count if element.properties else 0
    while read < count:
        block = blocks.next(count - read)
        if block is None:
            raise checks.InputError(f"the header claims {element.count} {element.name}; the file ends after {read}")
        read += kept.at_once(blocks, block.data) or kept.by_word(blocks.lines(block), read)
    return kept.columns()


class _Kept:
    """The properties asked for of one element of a text body."""

    def __init__(self, element: Element, names: Sequence[str]) -> None:
        own = element.properties
        self._element = element
        self._values = {p.name: array("q" if p.kind[0] in "iu" else "d") for p in own if p.name in names}
        self._lengths = {p.name: array("q") for p in own if p.name in names and p.length}
        self._readers = [text.whole if p.kind[0] in "iu" else text.number for p in own]
        self._plain = -1 if any(p.length for p in own) else len(own)
        self._whole = all(p.kind[0] in "iu" for p in own)
        self._one_list = own[0].length is not None and not any(p.length for p in own[1:])

    def columns(self) -> Columns:
        """All that was read."""
        arrays = {n: np.asarray(c).view(np.int64 if c.typecode == "q" else np.float64) for n, c in self._values.items()}
        sizes = {name: np.asarray(column).view(np.int64) for name, column in self._lengths.items()}
        return {name: (sizes[name], column) if name in sizes else column for name, column in arrays.items()}

    def at_once(self, blocks: text.Blocks, data: bytes) -> int:
        """How many rows of some lines were read: none where they are not plain numbers, as many as declared."""
        own = self._element.properties
        wanted_whole = any(p.kind[0] in "iu" for p in own if p.name in self._values)
        if (not self._whole and wanted_whole) or (self._plain < 0 and not self._one_list):
            return 0
        table = blocks.table(data, self._whole)
        if table is None or not table.counts.any():
            return 0
        words = table.counts[table.counts > 0]
        if self._plain > 0:
            if (words != self._plain).any():
                return 0
            rows = table.values.reshape(-1, self._plain)
            for i, p in enumerate(own):
                if p.name in self._values:
                    self._values[p.name].frombytes(rows[:, i].astype(self._values[p.name].typecode).tobytes())
            return len(rows)
        starts = np.cumsum(words) - words
        sizes = table.values[starts]
        if (sizes < 0).any() or (words != sizes + len(own)).any():
            return 0
        place = np.arange(len(table.values)) - np.repeat(starts, words)
        inside = np.repeat(sizes, words)
        for i, p in enumerate(own):
            if p.name in self._values:
                chosen = (place > 0) & (place <= inside) if i == 0 else place == inside + i
                self._values[p.name].frombytes(table.values[chosen].astype(self._values[p.name].typecode).tobytes())
            if p.name in self._lengths:
                self._lengths[p.name].frombytes(sizes.tobytes())
        return len(words)

    def by_word(self, lines: Iterator[tuple[int, bytes]], before: int) -> int:
        """The same word by word.

        Raises:
          InputError: a row that is too short or too long, or a word that is no number; the line is named.
        """
        rows = ((number, words) for number, line in lines if (words := line.split()))
        i = before
        for i, (number, words) in enumerate(rows, before + 1):
            where = f"line {number}"
            if len(words) == self._plain:
                for p, word, read in zip(self._element.properties, words, self._readers, strict=True):
                    if p.name in self._values:
                        self._values[p.name].append(read(word, where))
            else:
                self._long_row(words, where, i - 1)
        return i - before

    def _long_row(self, words: list[bytes], where: str, row: int) -> None:
        element, place = self._element, 0
        for p, read in zip(element.properties, self._readers, strict=True):
            size = 1
            if p.length:
                size = text.whole(words[place], where) if place < len(words) else -1
                place += 1
            if size < 0 or place + size > len(words):
                raise checks.InputError(f"{where}: the row of {element.name} {row} is too short: {len(words)} words")
            if p.name in self._values:
                self._values[p.name].extend([read(word, where) for word in words[place : place + size]])
            if p.name in self._lengths:
                self._lengths[p.name].append(size)
            place += size
        if place != len(words):
            raise checks.InputError(f"{where}: {len(words)} words in a row of {element.name}; {place} are declared")


def from_bytes(body: bytes, elements: list[Element], wanted: Wanted, order: str) -> Found:
    """Rows of a binary body; `order` is < or >."""
    found: Found = {}
    place = 0
    for element in elements:
        names = wanted.get(element.name, ())
        columns, place = _equal_rows(body, place, element, names, order) or _any_rows(
            body, place, element, names, order
        )
        if element.name in wanted:
            found[element.name] = columns
    rest = body[place : place + 4096].strip(b"\0 \t\r\n")
    if rest:
        raise checks.InputError(f"{len(body) - place} bytes follow that the header does not declare")
    return found


def _cut_short(element: Element, rows: int) -> checks.InputError:
    return checks.InputError(f"the header claims {element.count} {element.name}; the file ends after {rows}")


def _equal_rows(
    body: bytes, place: int, element: Element, names: Sequence[str], order: str
) -> tuple[Columns, int] | None:
    """All rows at once if their lists are as long as those of the first row; None if they are not."""
    if element.count == 0 or not element.properties:
        return {p.name: _nothing(p, order) for p in element.properties if p.name in names}, place
    sizes, after = [], place
    for p in element.properties:
        size = 1
        if p.length:
            size = _length(body, after, p.length, order, element)
            after += int(p.length[1:])
        if size < 0 or after + size * int(p.kind[1:]) > len(body):
            raise _cut_short(element, 0)
        sizes.append(size)
        after += size * int(p.kind[1:])
    if (after - place) * element.count > len(body) - place:
        if any(p.length for p in element.properties):
            return None
        raise _cut_short(element, (len(body) - place) // (after - place))
    fields = []
    for i, (p, size) in enumerate(zip(element.properties, sizes, strict=True)):
        fields += [(f"n{i}", order + p.length)] if p.length else []
        fields.append((f"v{i}", order + p.kind, (size,)))
    table = np.frombuffer(body, np.dtype(fields), element.count, place)
    columns: dict[str, np.ndarray | tuple[np.ndarray, np.ndarray]] = {}
    for i, (p, size) in enumerate(zip(element.properties, sizes, strict=True)):
        if p.length and (table[f"n{i}"] != size).any():
            return None
        if p.name in names:
            flat = table[f"v{i}"].reshape(-1)
            columns[p.name] = (np.full(element.count, size), flat) if p.length else flat
    return columns, place + (after - place) * element.count


def _any_rows(body: bytes, place: int, element: Element, names: Sequence[str], order: str) -> tuple[Columns, int]:
    """Where lists differ in length: first where each begins, row by row, then all values at once."""
    if element.count > MAX_UNEVEN:
        raise checks.InputError(f"{element.count} rows with lists of unequal length; at most {MAX_UNEVEN} are read")
    order_name = "big" if order == ">" else "little"
    lists, gap = [], 0  # of each list: bytes before its length, of its length, whether signed, of a value
    for p in element.properties:
        if p.length:
            lists.append((gap, int(p.length[1:]), p.length[0] == "i", int(p.kind[1:])))
        gap = 0 if p.length else gap + int(p.kind[1:])
    found, begins, size, end = array("q"), array("q"), 0, len(body)
    for row in range(element.count):
        begins.append(place)
        for before, head, signed, width in lists:
            place += before
            after = place + head
            size = int.from_bytes(body[place:after], order_name, signed=signed)
            if size < 0 or after > end:
                raise _cut_short(element, row)
            found.append(after)
            found.append(size)
            place = after + size * width
        place += gap
        if place > end:
            raise _cut_short(element, row)
    table = np.asarray(found).view(np.int64).reshape(element.count, len(lists), 2)
    columns: Columns = {}
    start, past = np.asarray(begins).view(np.int64), 0
    for p in element.properties:
        width = int(p.kind[1:])
        if not p.length:
            if p.name in names:
                columns[p.name] = _gathered(body, start, np.ones_like(start), order + p.kind)
            start = start + width
            continue
        first, sizes = table[:, past, 0], table[:, past, 1]
        past += 1
        if p.name in names:
            raw.require_few_corners(int(sizes.sum()))
            columns[p.name] = sizes.copy(), _gathered(body, first, sizes, order + p.kind)
        start = first + sizes * width
    return columns, place


def _gathered(body: bytes, first: np.ndarray, sizes: np.ndarray, kind: str) -> np.ndarray:
    """Values that lie in runs of some sizes, each from its own place on."""
    octets, width, pieces = np.frombuffer(body, np.uint8), np.dtype(kind).itemsize, []
    for i in range(0, len(first), _ROWS):
        some = sizes[i : i + _ROWS]
        inner = np.arange(int(some.sum())) - np.repeat(np.cumsum(some) - some, some)
        places = np.repeat(first[i : i + _ROWS], some) + width * inner
        pieces.append(octets[places[:, None] + np.arange(width)].reshape(-1).view(kind))
    return np.concatenate([np.zeros(0, kind), *pieces])


def _nothing(p: Property, order: str) -> np.ndarray | tuple[np.ndarray, np.ndarray]:
    values = np.zeros(0, order + p.kind)
    return (np.zeros(0, dtype=np.int64), values) if p.length else values


def _length(body: bytes, place: int, kind: str, order: str, element: Element) -> int:
    if place + int(kind[1:]) > len(body):
        raise _cut_short(element, 0)
    return int(np.frombuffer(body, order + kind, 1, place)[0])

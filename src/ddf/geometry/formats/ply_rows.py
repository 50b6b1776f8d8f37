"""The rows of a PLY file, text or binary; only the properties asked for are kept."""

from array import array
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from ddf.core import checks
from ddf.geometry.formats import text
from ddf.geometry.formats.ply_header import Element, Property

Wanted = Mapping[str, Sequence[str]]
Columns = dict[str, np.ndarray | tuple[np.ndarray, np.ndarray]]
Found = dict[str, Columns]
"""By element and property: a value per row; of lists their lengths, and all values one after the other."""


def from_text(body: bytes, elements: list[Element], wanted: Wanted, header_lines: int) -> Found:
    """Rows of a text body: one a line, as many words as declared. Blank lines are passed over."""
    rows = ((number + header_lines, line.split()) for number, line in text.lines(body))
    rows = ((number, words) for number, words in rows if words)
    found: Found = {}
    for element in elements:
        columns = _text_columns(element, wanted.get(element.name, ()), rows)
        if element.name in wanted:
            found[element.name] = columns
    extra = next(rows, None)
    if extra:
        raise checks.InputError(f"line {extra[0]}: rows follow that the header does not declare")
    return found


def _text_columns(element: Element, names: Sequence[str], rows: Iterator[tuple[int, list[bytes]]]) -> Columns:
    values = {p.name: array("q" if p.kind[0] in "iu" else "d") for p in element.properties if p.name in names}
    lengths = {p.name: array("q") for p in element.properties if p.name in names and p.length}
    readers = [text.whole if p.kind[0] in "iu" else text.number for p in element.properties]
    straight = [(values[p.name], i, readers[i]) for i, p in enumerate(element.properties) if p.name in values]
    plain = -1 if any(p.length for p in element.properties) else len(element.properties)
    for i in range(element.count if element.properties else 0):
        number, words = next(rows, (-1, []))
        if number < 0:
            raise checks.InputError(f"the header claims {element.count} {element.name}; the file ends after {i}")
        place, where = 0, f"line {number}"
        if len(words) == plain:
            for column, at, read in straight:
                column.append(read(words[at], where))
            continue
        for p, read in zip(element.properties, readers, strict=True):
            size = 1
            if p.length:
                size = text.whole(words[place], where) if place < len(words) else -1
                place += 1
            if size < 0 or place + size > len(words):
                raise checks.InputError(f"{where}: the row of {element.name} {i} is too short: {len(words)} words")
            if p.name in values:
                values[p.name].extend([read(word, where) for word in words[place : place + size]])
            if p.name in lengths:
                lengths[p.name].append(size)
            place += size
        if place != len(words):
            raise checks.InputError(f"{where}: {len(words)} words in a row of {element.name}; {place} are declared")
    arrays = {name: np.array(column) for name, column in values.items()}
    return {name: (np.array(lengths[name]), column) if name in lengths else column for name, column in arrays.items()}


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
        return {p.name: _column(p, [], order) for p in element.properties if p.name in names}, place
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
    """Row by row, where lists differ in length."""
    pieces: dict[str, list[bytes]] = {p.name: [] for p in element.properties if p.name in names}
    lengths: dict[str, array] = {name: array("q") for name in pieces}
    steps = [(p, int(p.kind[1:]), int(p.length[1:]) if p.length else 0) for p in element.properties]
    big = order == ">"
    for row in range(element.count):
        for p, width, head in steps:
            size = 1
            if p.length:
                if place + head > len(body):
                    raise _cut_short(element, row)
                size = int.from_bytes(body[place : place + head], "big" if big else "little", signed=p.length[0] == "i")
                place += head
            end = place + size * width
            if size < 0 or end > len(body):
                raise _cut_short(element, row)
            if p.name in pieces:
                pieces[p.name].append(body[place:end])
                lengths[p.name].append(size)
            place = end
    return {
        p.name: _column(p, pieces[p.name], order, lengths[p.name]) for p in element.properties if p.name in pieces
    }, place


def _column(
    p: Property, pieces: list[bytes], order: str, lengths: Sequence[int] = ()
) -> np.ndarray | tuple[np.ndarray, np.ndarray]:
    values = np.frombuffer(b"".join(pieces), order + p.kind)
    return (np.array(lengths, dtype=np.int64), values) if p.length else values


def _length(body: bytes, place: int, kind: str, order: str, element: Element) -> int:
    if place + int(kind[1:]) > len(body):
        raise _cut_short(element, 0)
    return int(np.frombuffer(body, order + kind, 1, place)[0])

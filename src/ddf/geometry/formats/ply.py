"""PLY, text and binary of both byte orders: its header, and the triangles or the points that it holds.

Our own reader: trimesh refuses lists of varying length, Open3D counts no words of a row, neither knows `tristrips`, and
both find `end_header` inside a comment. Only the properties that are asked for are kept.
"""

import re
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.formats import raw, text

MAX_HEADER = 1 << 20  # bytes
_LAST = {b"\n": re.compile(rb"\n[ \t]*end_header(?:[ \t][^\r\n]*)?(?:\r?\n|\Z)")}  # line of a header, by its line ends
_LAST[b"\r"] = re.compile(rb"\r[ \t]*end_header(?:[ \t][^\r\n]*)?(?:\r|\Z)")
_TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2"}
_TYPES |= {"uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "int64": "i8", "uint64": "u8"}
_TYPES |= {"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"}
_FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")
_FEW = 1 << 20  # rows without any property
MAX_UNEVEN = 8_000_000  # rows whose lists differ in length: some seconds
_ROWS = 1 << 18
_EXACT = 1 << 53  # a larger float64 may stand for several whole numbers
_NORMAL = ("nx", "ny", "nz")
_LISTS = ("vertex_indices", "vertex_index")
_Columns = dict[str, np.ndarray | tuple[np.ndarray, np.ndarray]]
_Found = dict[str, _Columns]
"""By element and property: a value per row; of lists their lengths, and all values one after the other."""


@dataclass(frozen=True)
class Property:
    """A number per row, or (`length` is a type) a list of them with its length before it; numpy's names of types."""

    name: str
    kind: str
    length: str | None = None


@dataclass
class Element:
    """So many rows with these properties."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    def least_bytes(self, as_text: bool) -> int:
        """Bytes that the shortest possible row takes."""
        if as_text:
            return 2 * len(self.properties)
        return sum(int((p.length or p.kind)[1:]) for p in self.properties)


@dataclass(frozen=True)
class Header:
    """Format, elements in order, and where the body begins."""

    form: str
    elements: list[Element]
    size: int
    num_lines: int


def parse(data: bytes) -> raw.Raw:
    """Vertices and triangles of a PLY file: of polygons (`face`) and of triangle strips (`tristrips`)."""
    wanted = {"vertex": ("x", "y", "z"), "face": _LISTS, "tristrips": _LISTS}
    found = _read(data, wanted)
    vertices = positions(found)
    sizes, corners = lists(found, "face")
    mesh = raw.of_polygons(vertices, sizes, corners)
    strips = _of_strips(*lists(found, "tristrips"))
    if len(strips) and not (0 <= strips.min() and strips.max() < len(vertices)):
        raise checks.InputError(f"a triangle strip uses vertex {strips.max()}, but there are only {len(vertices)}")
    return mesh._replace(faces=np.concatenate([mesh.faces, strips]))


def oriented(data: bytes) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"] | None]:
    """Vertices of a PLY cloud or mesh, and their normals as they stand there, None where it has none; InputError where
    there are none, or one is not finite.
    """
    found = _read(data, {"vertex": ("x", "y", "z", *_NORMAL)})
    vertices = positions(found)
    if len(vertices) == 0:
        raise checks.InputError("the cloud has no points")
    checks.require_finite("points", vertices)
    own = [raw.widened(np.asarray(found["vertex"][name])) for name in _NORMAL if name in found["vertex"]]
    return vertices, np.stack(own, axis=1) if len(own) == 3 else None


def _read(data: bytes, wanted: Mapping[str, Sequence[str]]) -> _Found:
    data = text.decoded(data)
    told = header(data)
    _check_vertices(told)
    body = data[told.size :]
    if told.form == "ascii":
        return from_text(text.Blocks(body, told.num_lines + 1), told.elements, wanted)
    return _from_bytes(body, told, wanted)


def _check_vertices(header: Header) -> None:
    vertices = next((element for element in header.elements if element.name == "vertex"), None)
    if vertices is None:
        raise checks.InputError("a PLY file must have an 'element vertex <count>'; this one has none")
    raw.require_few(vertices=vertices.count)
    axes = [p for p in vertices.properties if p.name in ("x", "y", "z")]
    if any(p.length for p in axes):
        raise checks.InputError("x, y and z of the vertices of a PLY file must be plain number properties, not lists")
    if len(axes) < 3:
        names = ", ".join(p.name[:20] for p in vertices.properties[:20])
        raise checks.InputError(f"the vertices of a PLY file must have x, y and z; got {names or 'nothing'}")


def positions(found: _Found) -> Float[np.ndarray, "n 3"]:
    """x, y and z of the vertices."""
    return np.stack([raw.widened(np.asarray(found["vertex"][axis])) for axis in "xyz"], axis=1)


def lists(found: _Found, element: str) -> tuple[np.ndarray, np.ndarray]:
    """Lengths and values of the element's list of vertices; none where it has no such element."""
    nothing = np.zeros(0, dtype=np.int64)
    own = found.get(element)
    if own is None:
        return nothing, nothing
    lists = [values for values in own.values() if isinstance(values, tuple)]
    if len(lists) != 1:
        raise checks.InputError(f"element {element} must have one list vertex_indices; got {len(lists)}")
    sizes, values = lists[0]
    if values.dtype.kind == "f":
        raise checks.InputError(f"the list vertex_indices of element {element} must hold whole numbers, not floats")
    raw.require_few(corners=len(values))
    return sizes.astype(np.int64, copy=False), values.astype(np.int64, copy=False)


def _of_strips(sizes: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Triangles of strips, every second one turned; -1 ends a strip inside a row."""
    ends = np.zeros(len(values), dtype=bool)
    ends[np.cumsum(sizes[sizes > 0])[:-1]] = True
    label = np.cumsum(ends | (values == -1))  # strips by number; a -1 opens one and is no part of it
    keep = values != -1
    label, values = label[keep], values[keep]
    if len(values) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    first = np.flatnonzero(np.diff(label, prepend=-1))
    place = np.arange(len(values)) - np.repeat(first, np.diff(first, append=len(values)))
    start = np.flatnonzero(label[2:] == label[:-2])
    faces = np.stack([values[start], values[start + 1], values[start + 2]], axis=1)
    odd = place[start] % 2 == 1
    faces[odd] = faces[odd][:, [1, 0, 2]]
    return faces


def header(data: bytes) -> Header:
    """The header, read line by line; the counts are compared with the bytes that follow."""
    lines, place = _lines(data)
    forms, elements = [], []
    for line in filter(None, (line.decode("utf-8", "replace").split() for line in lines)):
        if line[0] == "format" and len(line) >= 2:
            forms.append(line[1])
        elif line[0] == "element":
            elements.append(_element(line, elements))
        elif line[0] == "property" and elements:
            elements[-1].properties.append(_property(line, elements[-1]))
        elif line[0] not in ("comment", "obj_info"):
            raise checks.InputError(f"not a ply mesh: bad header line {_shown(line)}")
    if len(forms) != 1 or forms[0] not in _FORMATS:
        raise checks.InputError(f"PLY format must be ascii or binary; got {', '.join(forms)[:60] or 'none'!r}")
    left = len(data) - place + 1
    for element in elements:
        least = element.least_bytes(forms[0] == "ascii")
        if least == 0 and element.count > _FEW:
            raise checks.InputError(f"element {element.name} claims {element.count} rows without properties")
        raw.require_room(element.name, element.count, least, left)
        left -= element.count * least
    return Header(forms[0], elements, place, len(lines) + 2)


def _lines(data: bytes) -> tuple[list[bytes], int]:
    """The lines between `ply` and `end_header`, and the place after it.

    Lines end as the first one does: a body may begin with the byte of another line end.
    """
    if not data.startswith((b"ply\n", b"ply\r", b"ply ", b"ply\t")):
        raise checks.InputError("not a PLY file: no ply header")
    feed, back = data.find(b"\n", 0, MAX_HEADER), data.find(b"\r", 0, MAX_HEADER)
    end = b"\r" if back >= 0 and (feed < 0 or feed > back + 1) else b"\n"
    last = _LAST[end].search(data, 0, MAX_HEADER)
    if last is None:
        raise checks.InputError("not a PLY file: no ply header that ends with the line 'end_header'")
    return data[: last.start()].split(end)[1:], last.end()


def _element(line: list[str], before: list[Element]) -> Element:
    if len(line) != 3 or not (line[2].isascii() and line[2].isdigit() and len(line[2]) < 19):
        raise checks.InputError(f"not a ply mesh: bad header line {_shown(line)}")
    if any(element.name == line[1] for element in before):
        raise checks.InputError(f"not a ply mesh: element {line[1][:40]!r} is declared twice")
    return Element(line[1], int(line[2]))


def _property(line: list[str], element: Element) -> Property:
    is_list = line[1:2] == ["list"]
    kinds = line[2:4] if is_list else line[1:2]
    if len(line) != (5 if is_list else 3) or any(kind not in _TYPES for kind in kinds):
        raise checks.InputError(f"not a ply mesh: bad header line {_shown(line)}")
    name, types = line[-1], [_TYPES[kind] for kind in kinds]
    if any(known.name == name for known in element.properties):
        raise checks.InputError(f"not a ply mesh: property {name[:40]!r} of {element.name[:40]} is declared twice")
    if is_list and types[0][0] == "f":
        raise checks.InputError(f"not a ply mesh: the length of list {name[:40]!r} must be a whole number")
    return Property(name, types[-1], types[0] if is_list else None)


def _shown(line: list[str]) -> str:
    return ascii(" ".join(line)[:80])


def from_text(
    blocks: text.Blocks, elements: Sequence[Element], wanted: Mapping[str, Sequence[str]], spare: bool = False
) -> _Found:
    """Rows of a text body: one a line, as many words as declared, or with `spare` more. Blank lines are passed over."""
    found: _Found = {}
    for element in elements:
        pieces: list[_Columns] = []
        read, count = 0, element.count if element.properties else 0
        while read < count:
            block = blocks.next(count - read)
            if block is None:
                raise _cut_short(element, read)
            columns, rows = _text_rows(blocks, block, element, wanted.get(element.name, ()), read, spare)
            pieces += [columns] if rows else []
            read += rows
        if element.name in wanted:
            found[element.name] = _joined(pieces or [_nothing(element, "<")], wanted[element.name])
    while block := blocks.next():
        for number, line in blocks.lines(block):
            if line.split():
                raise checks.InputError(f"line {number}: rows follow that the header does not declare")
    return found


def _text_rows(
    blocks: text.Blocks, block: text.Block, element: Element, names: Sequence[str], before: int, spare: bool
) -> tuple[_Columns, int]:
    """The rows of some lines, property after property, and how many there are; `before`: rows already read."""
    values, counts, bad = _words(blocks, block, all(p.kind[0] in "iu" for p in element.properties))
    lines, words = block.number + np.flatnonzero(counts), counts[counts > 0]
    ends = np.cumsum(words)
    place, columns = ends - words, _Columns()

    def taken(index: Int[np.ndarray, "k"], rows: Int[np.ndarray, "k"], whole: bool) -> np.ndarray:
        chosen = values[index]
        wrong = np.isin(index, bad) if len(bad) else np.zeros(len(index), dtype=bool)
        if whole and chosen.dtype.kind == "f":
            wrong = wrong | ~(np.abs(chosen) < _EXACT) | (np.floor(chosen) != chosen)
        if wrong.any():
            first = int(np.argmax(wrong))
            word = block.data.split()[index[first]]
            kind = "a whole number" if whole else "a number"
            raise checks.InputError(f"line {lines[rows[first]]}: {text.shown(word)} is not {kind}")
        return chosen.astype(np.int64) if whole else chosen.astype(np.float64)

    for p in element.properties:
        sizes = np.ones(len(words), dtype=np.int64)
        if p.length:
            there = np.flatnonzero(place < ends)
            sizes[:] = -1
            sizes[there] = taken(place[there], there, whole=True)
            place = place + 1
        short = (sizes < 0) | (sizes > ends - place)
        if short.any():
            row = int(np.argmax(short))
            where = f"line {lines[row]}: the row of {element.name} {before + row}"
            raise checks.InputError(f"{where} is too short: {words[row]} words")
        if p.name in names:
            own = taken(_runs(place, sizes), np.repeat(np.arange(len(words)), sizes), p.kind[0] in "iu")
            columns[p.name] = (sizes, own) if p.length else own
        place = place + sizes
    if not spare and (place != ends).any():
        row = int(np.argmax(place != ends))
        declared = words[row] - (ends - place)[row]
        raise checks.InputError(
            f"line {lines[row]}: {words[row]} words in a row of {element.name}; {declared} are declared"
        )
    return columns, len(words)


def _words(
    blocks: text.Blocks, block: text.Block, whole: bool
) -> tuple[np.ndarray, Int[np.ndarray, "l"], Int[np.ndarray, "b"]]:
    """All words of some lines as numbers, how many each line has, and which of them are none."""
    table = blocks.table(block.data, whole)
    if table is not None:
        return table.values, table.counts, np.zeros(0, dtype=np.int64)
    values, counts, bad, read = array("d"), array("q"), array("q"), text.whole if whole else text.number
    for _, line in blocks.lines(block):
        words = line.split()
        counts.append(len(words))
        for word in words:
            try:
                values.append(read(word, ""))
            except checks.InputError:
                bad.append(len(values))
                values.append(float("nan"))
    return np.asarray(values), np.asarray(counts).view(np.int64), np.asarray(bad).view(np.int64)


def _runs(first: Int[np.ndarray, "r"], sizes: Int[np.ndarray, "r"]) -> Int[np.ndarray, "k"]:
    """Whole numbers in runs of some sizes, each from its own place on."""
    return np.arange(int(sizes.sum())) + np.repeat(first - np.cumsum(sizes) + sizes, sizes)


def _joined(pieces: list[_Columns], names: Sequence[str]) -> _Columns:
    columns: _Columns = {}
    for name in (name for name in pieces[0] if name in names):
        own: list[Any] = [piece[name] for piece in pieces]
        if isinstance(own[0], tuple):
            columns[name] = np.concatenate([sizes for sizes, _ in own]), np.concatenate([values for _, values in own])
        else:
            columns[name] = np.concatenate(own)
    return columns


def _from_bytes(body: bytes, told: Header, wanted: Mapping[str, Sequence[str]]) -> _Found:
    """Rows of a binary body."""
    found: _Found = {}
    place, order = 0, ">" if told.form == "binary_big_endian" else "<"
    for element in told.elements:
        names = wanted.get(element.name, ())
        columns, place = _equal_rows(body, place, element, order) or _uneven_rows(body, place, element, names, order)
        if element.name in wanted:
            found[element.name] = {name: values for name, values in columns.items() if name in names}
    if body[place : place + 4096].strip(b"\0 \t\r\n"):
        raise checks.InputError(f"{len(body) - place} bytes follow that the header does not declare")
    return found


def _cut_short(element: Element, rows: int) -> checks.InputError:
    return checks.InputError(f"the header claims {element.count} {element.name}; the file ends after {rows}")


def _nothing(element: Element, order: str) -> _Columns:
    columns: _Columns = {}
    for p in element.properties:
        values = np.zeros(0, order + p.kind)
        columns[p.name] = (np.zeros(0, dtype=np.int64), values) if p.length else values
    return columns


def _equal_rows(body: bytes, place: int, element: Element, order: str) -> tuple[_Columns, int] | None:
    """All rows at once if their lists are as long as those of the first row; None if they are not."""
    if element.count == 0 or not element.properties:
        return _nothing(element, order), place
    fields, wanted, after = [], {}, place
    for i, p in enumerate(element.properties):
        size = 1
        if p.length:
            head = int(p.length[1:])
            if after + head > len(body):
                raise _cut_short(element, 0)
            size = int(np.frombuffer(body, order + p.length, 1, after)[0])
            after += head
            fields.append((f"n{i}", order + p.length))
            wanted[f"n{i}"] = size
        after += size * int(p.kind[1:])
        if size < 0 or after > len(body):
            raise _cut_short(element, 0)
        fields.append((f"v{i}", order + p.kind, (size,)))
    if (after - place) * element.count > len(body) - place:
        if wanted:
            return None
        raise _cut_short(element, (len(body) - place) // (after - place))
    table = np.frombuffer(body, np.dtype(fields), element.count, place)
    if any((table[name] != size).any() for name, size in wanted.items()):
        return None
    columns: _Columns = {}
    for i, p in enumerate(element.properties):
        flat = table[f"v{i}"].reshape(-1)
        columns[p.name] = (np.full(element.count, wanted[f"n{i}"]), flat) if p.length else flat
    return columns, place + (after - place) * element.count


def _uneven_rows(body: bytes, place: int, element: Element, names: Sequence[str], order: str) -> tuple[_Columns, int]:
    """Where lists differ in length: first where each property of a row begins, row by row, then all values at once."""
    if element.count > MAX_UNEVEN:
        raise checks.InputError(f"{element.count} rows with lists of unequal length; at most {MAX_UNEVEN} are read")
    order_name = "big" if order == ">" else "little"
    kept = [p for p in element.properties if p.name in names]
    heads = [(int(p.length[1:]), p.length[0] == "i") if p.length else (0, False) for p in element.properties]
    plan = [(*head, int(p.kind[1:]), p in kept) for head, p in zip(heads, element.properties, strict=True)]
    starts = array("q")  # row by row: of each property that is kept where it begins, and how many values it has
    for row in range(element.count):
        for head, signed, width, keep in plan:
            size = 1
            if head:
                size = int.from_bytes(body[place : place + head], order_name, signed=signed)
                place += head
            if size < 0 or place > len(body):
                raise _cut_short(element, row)
            if keep:
                starts.append(place)
                starts.append(size)
            place += size * width
        if place > len(body):
            raise _cut_short(element, row)
    table = np.asarray(starts).view(np.int64).reshape(element.count, len(kept), 2)
    columns: _Columns = {}
    for i, p in enumerate(kept):
        first, sizes = table[:, i, 0], table[:, i, 1].copy()
        raw.require_few(corners=int(sizes.sum()))
        values = _gathered(body, first, sizes, order + p.kind)
        columns[p.name] = (sizes, values) if p.length else values
    return columns, place


def _gathered(body: bytes, first: np.ndarray, sizes: np.ndarray, kind: str) -> np.ndarray:
    """Values that lie in runs of some sizes, each from its own place on."""
    octets, width, pieces = np.frombuffer(body, np.uint8), np.dtype(kind).itemsize, [np.zeros(0, kind)]
    for i in range(0, len(first), _ROWS):
        places = _runs(first[i : i + _ROWS], sizes[i : i + _ROWS] * width)
        pieces.append(octets[places].view(kind))
    return np.concatenate(pieces)

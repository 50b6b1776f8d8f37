"""The header of a PLY file: its format, and the elements with their properties."""

from dataclasses import dataclass, field

from ddf.core import checks
from ddf.geometry.formats import raw

MAX_HEADER = 1 << 20  # bytes
TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2"}
TYPES |= {"uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "int64": "i8", "uint64": "u8"}
TYPES |= {"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"}
_FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")
_FEW = 1 << 20  # rows without any property


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


def parse(data: bytes) -> Header:
    """The header, read line by line; the counts are compared with the bytes that follow.

    Raises:
      InputError: no header, a line that is none of a PLY header, a count that the file cannot hold.
    """
    words, place, num_lines = _lines(data)
    forms, elements = [], []
    for line in words:
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
    return Header(forms[0], elements, place, num_lines)


def _lines(data: bytes) -> tuple[list[list[str]], int, int]:
    """Words of the lines between `ply` and `end_header`, the place after it, and how many lines these are.

    Lines end as the first one does: a body may begin with the byte of another line end.
    """
    if not data.startswith((b"ply\n", b"ply\r", b"ply ", b"ply\t")):
        raise checks.InputError("not a PLY file: no ply header")
    feed, back = data.find(b"\n", 0, MAX_HEADER), data.find(b"\r", 0, MAX_HEADER)
    end = b"\r" if back >= 0 and (feed < 0 or feed > back + 1) else b"\n"
    words, place = [], data.find(end) + 1
    while True:
        stop = data.find(end, place, place + MAX_HEADER)
        last = data[place : stop if stop >= 0 else place + 80].split()
        if last[:1] == [b"end_header"]:
            return words, stop + 1 if stop >= 0 else len(data), len(words) + 2
        if stop < 0 or stop > MAX_HEADER:
            raise checks.InputError("not a PLY file: no ply header that ends with the line 'end_header'")
        if last:
            words.append([word.decode("utf-8", "replace") for word in last])
        else:
            words.append(["comment"])
        place = stop + 1


def _element(line: list[str], before: list[Element]) -> Element:
    if len(line) != 3 or not (line[2].isascii() and line[2].isdigit() and len(line[2]) < 19):
        raise checks.InputError(f"not a ply mesh: bad header line {_shown(line)}")
    if any(element.name == line[1] for element in before):
        raise checks.InputError(f"not a ply mesh: element {line[1][:40]!r} is declared twice")
    return Element(line[1], int(line[2]))


def _property(line: list[str], element: Element) -> Property:
    is_list = line[1:2] == ["list"]
    kinds = line[2:4] if is_list else line[1:2]
    if len(line) != (5 if is_list else 3) or any(kind not in TYPES for kind in kinds):
        raise checks.InputError(f"not a ply mesh: bad header line {_shown(line)}")
    name, types = line[-1], [TYPES[kind] for kind in kinds]
    if any(known.name == name for known in element.properties):
        raise checks.InputError(f"not a ply mesh: property {name[:40]!r} of {element.name[:40]} is declared twice")
    if is_list and types[0][0] == "f":
        raise checks.InputError(f"not a ply mesh: the length of list {name[:40]!r} must be a whole number")
    return Property(name, types[-1], types[0] if is_list else None)


def _shown(line: list[str]) -> str:
    return ascii(" ".join(line)[:80])

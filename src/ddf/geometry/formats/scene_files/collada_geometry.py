"""The polygons of one geometry of a COLLADA file: sources by their accessors, all kinds of primitives."""

from collections.abc import Iterable
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.formats import raw, text
from ddf.geometry.formats.scene_files import parts, xml_text

_LEFT_OUT = ("lines", "linestrips")
_SIZES = {"triangles": 3, "trifans": 0, "tristrips": 0, "polygons": 0, "polylist": 0}


class Ids:
    """Elements by tag and id: those of one geometry first, then those of the file, where ids may come again."""

    def __init__(self, elements: Iterable[Element] = (), others: "Ids | None" = None) -> None:
        self._found: dict[tuple[str, str], Element] = {}
        self._twice: set[tuple[str, str]] = set()
        self._others = others
        for element in elements:
            self.add(element)

    def add(self, element: Element) -> None:
        """One more element, if it has an id."""
        key = element.tag, element.get("id", "")
        if key[1] and self._found.setdefault(key, element) is not element:
            self._twice.add(key)

    def get(self, key: str, *tags: str) -> Element | None:
        """The element of one of these kinds with the id.

        Raises:
          InputError: there are two.
        """
        for tag in tags:
            if (tag, key) in self._twice:
                raise checks.InputError(f"two {tag} elements have the id {key[:40]!a}; which is meant is not clear")
            if (tag, key) in self._found:
                return self._found[tag, key]
        return None if self._others is None else self._others.get(key, *tags)


def triangles(geometry: Element, ids: Ids, remarks: dict[str, None]) -> parts.Part:
    """Positions and triangles of a geometry, in its own frame.

    Raises:
      InputError: it is no mesh of polygons, or something in it points at nothing.
    """
    mesh = geometry.find("mesh")
    if mesh is None:
        kind = geometry[0].tag if len(geometry) else "nothing"
        raise checks.InputError(f"a geometry is {kind[:20]!a}, not a mesh; save it as triangles")
    ids = Ids(geometry.iter(), ids)
    tables: dict[str, tuple[int, Float[np.ndarray, "n 3"]]] = {}  # first vertex of each source, and its positions
    counts, corners = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    num_vertices = 0
    for element in mesh:
        if element.tag in _LEFT_OUT:
            remarks[f"primitives of {element.tag} are left out"] = None
        if element.tag not in _SIZES:
            continue
        source, offset, stride = _inputs(element, ids)
        if source not in tables:
            tables[source] = num_vertices, _positions(ids, source)
            num_vertices += len(tables[source][1])
        first, positions = tables[source]
        sizes, index = _polygons(element, offset, stride)
        if len(index) and index.max() >= len(positions):
            raise checks.InputError(f"a face uses vertex {index.max()}, but there are only {len(positions)}")
        counts.append(sizes)
        corners.append(index + first)
    vertices = np.concatenate([np.zeros((0, 3)), *(positions for _, positions in tables.values())])
    read = raw.of_polygons(vertices, np.concatenate(counts), np.concatenate(corners))
    remarks.update(dict.fromkeys(read.remarks))
    return read.vertices, read.faces


def _inputs(primitive: Element, ids: Ids) -> tuple[str, int, int]:
    """Id of the source of positions, the place of its index among those of a corner, and how many a corner has."""
    stride, found = 0, None
    for element in primitive.findall("input"):
        offset = text.whole(element.get("offset", "0").encode(), "an input's offset")
        stride = max(stride, offset + 1)
        if element.get("semantic") == "VERTEX":
            found = element.get("source", "")[1:], offset
    vertices = ids.get(found[0], "vertices") if found else None
    if found is None or vertices is None or not 0 < stride <= 64:
        raise checks.InputError(f"{primitive.tag} without an input of semantic VERTEX")
    for element in vertices.findall("input"):
        if element.get("semantic") == "POSITION":
            return element.get("source", "")[1:], found[1], stride
    raise checks.InputError("vertices without an input of semantic POSITION")


def _positions(ids: Ids, key: str) -> Float[np.ndarray, "n 3"]:
    source = ids.get(key, "source")
    accessor = None if source is None else source.find("technique_common/accessor")
    array = None if accessor is None else ids.get(accessor.get("source", "")[1:], "float_array", "int_array")
    if accessor is None or array is None:
        raise checks.InputError(f"there is no source of positions {key[:40]!a}")
    values = xml_text.numbers(array.text or "", "a position")
    count, offset, stride = (
        text.whole(accessor.get(name, default).encode(), f"an accessor's {name}")
        for name, default in (("count", "0"), ("offset", "0"), ("stride", "1"))
    )
    if stride < 3 or offset < 0 or count < 0 or (count and offset + stride * (count - 1) + 3 > len(values)):
        raise checks.InputError(f"an accessor of {count} positions reaches beyond its {len(values)} numbers")
    named = [parameter.get("name", "") for parameter in accessor.findall("param")]
    order = [named.index(axis) for axis in "XYZ"] if {"X", "Y", "Z"} <= set(named) else [0, 1, 2]
    if max(order) >= stride:
        raise checks.InputError("an accessor has more params than its stride")
    rows = offset + stride * np.arange(count)
    columns = rows[:, None] + np.array(order)
    if columns.size and columns.max() >= len(values):
        raise checks.InputError(f"an accessor of {count} positions reaches beyond its {len(values)} numbers")
    return values[columns]


def _polygons(primitive: Element, offset: int, stride: int) -> tuple[Int[np.ndarray, "p"], Int[np.ndarray, "c"]]:
    """Corners of each polygon, and the positions of all corners."""
    if primitive.find("ph") is not None:
        raise checks.InputError("a polygon has a hole; cut it into triangles first")
    lists = [_whole(element, primitive.tag) for element in primitive.findall("p")]
    for each in lists:
        if len(each) % stride:
            raise checks.InputError(f"{primitive.tag}: {len(each)} indices are no multiple of {stride}")
    strips = [each[offset::stride] for each in lists]
    joined = np.concatenate([np.zeros(0, dtype=np.int64), *strips])
    if primitive.tag == "polygons":
        return np.array([len(strip) for strip in strips], dtype=np.int64), joined
    if primitive.tag == "polylist":
        found = primitive.find("vcount")
        sizes = np.zeros(0, dtype=np.int64) if found is None else _whole(found, "vcount")
        claimed, primitives = int(sizes.sum()), len(sizes)
    elif primitive.tag == "triangles":
        if len(joined) % 3:
            raise checks.InputError(f"triangles: {len(joined)} corners are no multiple of three")
        sizes = np.full(len(joined) // 3, 3)
        claimed, primitives = len(joined), len(sizes)
    else:
        joined = np.concatenate([np.zeros(0, dtype=np.int64), *(_cut(strip, primitive.tag) for strip in strips)])
        sizes, claimed, primitives = np.full(len(joined) // 3, 3), len(joined), len(strips)
    given = text.whole(primitive.get("count", str(primitives)).encode(), f"the count of {primitive.tag}")
    if claimed != len(joined) or given != primitives:
        raise checks.InputError(
            f"{primitive.tag}: the file claims {given} of them with {claimed} corners; {primitives} with "
            f"{len(joined)} are there"
        )
    return sizes, joined


def _cut(strip: Int[np.ndarray, "k"], kind: str) -> Int[np.ndarray, "c"]:
    """The triangles of a strip or fan, one after the other."""
    if len(strip) < 3:
        return np.zeros(0, dtype=np.int64)
    first, second, third = strip[:-2], strip[1:-1], strip[2:]
    if kind == "trifans":
        return np.stack([np.full(len(second), strip[0]), second, third], axis=1).reshape(-1)
    odd = np.arange(len(first)) % 2 == 1
    return np.stack([first, np.where(odd, third, second), np.where(odd, second, third)], axis=1).reshape(-1)


def _whole(element: Element, name: str) -> Int[np.ndarray, "k"]:
    found = xml_text.whole_numbers(element.text or "", name)
    if len(found) and found.min() < 0:
        raise checks.InputError(f"{name}: an index is {found.min()}; indices start at 0")
    return found

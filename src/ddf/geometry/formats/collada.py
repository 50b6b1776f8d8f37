"""COLLADA 1.4 and 1.5 (DAE): the triangles of the scene, transforms and instances applied, coordinates as written.

Our own reader: trimesh passes over faults and skins without a word, fans concave polygons and reads float32. Neither
the unit nor the up axis of the file is applied, as no other format's is: a remark names an up axis other than Y.
"""

import math
from collections import ChainMap
from collections.abc import Iterable, Iterator, MutableMapping
from xml.etree.ElementTree import Element, TreeBuilder

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.formats import raw, scenes, text

_DEEPEST = 128  # nodes in nodes
_MOST = 50_000  # geometries placed
_VISITED = 300_000  # nodes and what they hold, each as often as it is used
_ELEMENTS = 2_000_000  # and attributes of a file: a tree of some hundred bytes each
_BOUND = 8  # controllers on controllers
_CHUNK = 1 << 20  # bytes
_LEFT_OUT = ("lines", "linestrips")
_PRIMITIVES = ("triangles", "trifans", "tristrips", "polygons", "polylist")


_Ids = MutableMapping[tuple[str, str], list[Element]]  # elements by tag and id


def _by_id(elements: Iterable[Element]) -> _Ids:
    found: dict[tuple[str, str], list[Element]] = {}
    for element in elements:
        if key := element.get("id"):
            found.setdefault((element.tag, key), []).append(element)
    return found


def _get(ids: _Ids, reference: str | None, *tags: str) -> Element:
    """The element of one of these kinds that `#id` names; two that could be meant are refused."""
    reference = reference or ""
    if not reference.startswith("#"):
        raise checks.InputError(f"{reference[:80]!a} points outside the file")
    for tag in tags:
        found = ids.get((tag, reference[1:]), [])
        if len(found) > 1:
            raise checks.InputError(f"two {tag} elements have the id {reference[1:41]!a}; which is meant is not clear")
        if found:
            return found[0]
    raise checks.InputError(f"there is no {tags[0]} {reference[1:41]!a}")


class _Tree(scenes.Target):
    """All elements, without their namespaces."""

    def __init__(self) -> None:
        self._builder, self._count = TreeBuilder(), 0
        self.data = self._builder.data

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        self._count += 1 + len(attributes)
        if self._count > _ELEMENTS:
            raise checks.InputError(f"its XML has more than {_ELEMENTS} elements and attributes")
        self._builder.start(tag.rpartition("}")[2], attributes)

    def end(self, tag: str) -> None:
        """An element ends."""
        self._builder.end(tag.rpartition("}")[2])

    def close(self) -> Element:
        """The root of the tree."""
        return self._builder.close()


def parse(data: bytes) -> raw.Raw:
    """All triangles of the scene, in the order of its nodes.

    Raises:
      InputError: no COLLADA, more than 128 MiB, no scene, references to nothing or outside the file, a transform or a
        kind of geometry that is not read, nodes in a circle, more than 20 million triangles.
    """
    root = scenes.read_xml((data[place : place + _CHUNK] for place in range(0, len(data), _CHUNK)), _Tree())
    if root.tag != "COLLADA":
        raise checks.InputError(f"not a dae mesh: its root is {root.tag[:40]!a}, not COLLADA")
    scene, ids = scenes.Scene(_MOST), _by_id(root.iter())
    up = root.findtext("asset/up_axis", "Y_UP").strip()
    if up != "Y_UP":
        scene.remarks[f"its up axis is {ascii(up[:10])[1:-1]}; coordinates are as written, not turned"] = None
    made: dict[Element, scenes.Part] = {}
    for geometry, matrix in _placements(ids, root, scene.remarks):
        if geometry not in made:
            made[geometry] = _triangles(geometry, ids, scene.remarks)
        scene.require_room(len(made[geometry][1]))
        scene.place(made[geometry], matrix)
    return scene.joined()


def _placements(
    ids: _Ids, root: Element, remarks: dict[str, None]
) -> Iterator[tuple[Element, Float[np.ndarray, "4 4"]]]:
    """Every geometry of the scene, and its transform."""
    chosen = root.find("scene/instance_visual_scene")
    found = root.findall("library_visual_scenes/visual_scene")
    if chosen is not None:
        found = [_get(ids, chosen.get("url"), "visual_scene")]
    if len(found) != 1:
        raise checks.InputError(f"the file names no scene and has {len(found)}")
    stack = [(node, np.eye(4), 0) for node in reversed(found[0].findall("node"))]
    visited = 0
    while stack:
        node, matrix, depth = stack.pop()
        visited += 1 + len(node)
        if depth > _DEEPEST or visited > _VISITED:
            raise checks.InputError("its nodes form a circle, or are too many")
        for child in node:
            matrix = scenes.product(matrix, _transform(child))
        for child in node:
            if child.tag in ("instance_geometry", "instance_controller"):
                if not np.isfinite(matrix).all():
                    raise checks.InputError("a node has a lookat or skew, which are not read; save it as a matrix")
                geometry, bound = _unskinned(ids, child.get("url"), remarks)
                yield geometry, matrix @ bound
        inner = node.findall("node") + [_get(ids, each.get("url"), "node") for each in node.findall("instance_node")]
        stack += [(child, matrix, depth + 1) for child in reversed(inner)]


def _transform(element: Element) -> Float[np.ndarray, "4 4"]:
    """The matrix of one transform of a node, not finite where it is not read; the identity for any other element."""
    matrix = np.eye(4)
    if element.tag in ("lookat", "skew"):
        matrix[:] = np.nan
    elif element.tag == "matrix":
        matrix = _numbers(element, 16).reshape(4, 4)
    elif element.tag == "translate":
        matrix[:3, 3] = _numbers(element, 3)
    elif element.tag == "scale":
        matrix[:3, :3] = np.diag(_numbers(element, 3))
    elif element.tag == "rotate":
        *axis, degrees = _numbers(element, 4)
        length = math.hypot(*axis)
        x, y, z = (value / (length or 1.0) for value in axis)
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = math.radians(degrees) if length else 0.0
        matrix[:3, :3] += math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross  # Rodrigues
    return matrix


def _unskinned(ids: _Ids, reference: str | None, remarks: dict[str, None]) -> tuple[Element, Float[np.ndarray, "4 4"]]:
    """The geometry, under any skins and morphs, and the transform that binds it."""
    bound = np.eye(4)
    for _ in range(_BOUND):
        element = _get(ids, reference, "geometry", "controller")
        if element.tag == "geometry":
            return element, bound
        inner = element.find("skin")
        if inner is not None:
            remarks["skins are not applied: the mesh is read as modelled"] = None
            shape = inner.find("bind_shape_matrix")
            bound = bound if shape is None else bound @ _numbers(shape, 16).reshape(4, 4)
        else:
            remarks["morph targets are not applied"] = None
            inner = element.find("morph")
        reference = None if inner is None else inner.get("source")
    raise checks.InputError("its controllers form a circle, or are too many")


def _numbers(element: Element, count: int) -> Float[np.ndarray, "k"]:
    return scenes.numbers(scenes.decimals(element.text or "", element.tag).tolist(), count, element.tag)


def _triangles(geometry: Element, ids: _Ids, remarks: dict[str, None]) -> scenes.Part:
    """Positions and triangles of a geometry, in its own frame."""
    mesh = geometry.find("mesh")
    if mesh is None:
        kind = geometry[0].tag if len(geometry) else "nothing"
        raise checks.InputError(f"a geometry is {kind[:20]!a}, not a mesh; save it as triangles")
    ids = ChainMap(_by_id(geometry.iter()), ids)  # its own first: those of the file may come again
    tables: dict[Element, tuple[int, Float[np.ndarray, "n 3"]]] = {}  # first vertex of each source, and its positions
    counts, corners = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    num_vertices = 0
    for element in mesh:
        if element.tag in _LEFT_OUT:
            remarks[f"primitives of {element.tag} are left out"] = None
        if element.tag not in _PRIMITIVES:
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


def _inputs(primitive: Element, ids: _Ids) -> tuple[Element, int, int]:
    """The source of positions, the place of its index among those of a corner, and how many a corner has."""
    inputs = primitive.findall("input")
    offsets = [text.whole(each.get("offset", "0").encode(), "an input's offset") for each in inputs]
    stride = max(offsets, default=0) + 1
    named = {each.get("semantic"): (each.get("source"), offset) for each, offset in zip(inputs, offsets, strict=True)}
    if "VERTEX" not in named or not 0 < stride <= 64:
        raise checks.InputError(f"{primitive.tag} without an input of semantic VERTEX")
    vertices, place = named["VERTEX"]
    for each in _get(ids, vertices, "vertices").findall("input"):
        if each.get("semantic") == "POSITION":
            return _get(ids, each.get("source"), "source"), place, stride
    raise checks.InputError("vertices without an input of semantic POSITION")


def _positions(ids: _Ids, source: Element) -> Float[np.ndarray, "n 3"]:
    accessor = source.find("technique_common/accessor")
    if accessor is None:
        raise checks.InputError("a source of positions has no accessor")
    array = _get(ids, accessor.get("source"), "float_array", "int_array")
    values = scenes.decimals(array.text or "", "a position")
    count, offset, stride = (
        text.whole(accessor.get(name, default).encode(), f"an accessor's {name}")
        for name, default in (("count", "0"), ("offset", "0"), ("stride", "1"))
    )
    named = [parameter.get("name", "") for parameter in accessor.findall("param")]
    order = [named.index(axis) for axis in "XYZ"] if {"X", "Y", "Z"} <= set(named) else [0, 1, 2]
    last = offset + stride * (count - 1) + max(2, *order)
    if stride <= max(2, *order) or offset < 0 or count < 0 or (count and last >= len(values)):
        raise checks.InputError(f"an accessor of {count} positions reaches beyond its {len(values)} numbers")
    return values[offset + stride * np.arange(count)[:, None] + np.array(order)]


def _polygons(primitive: Element, offset: int, stride: int) -> tuple[Int[np.ndarray, "p"], Int[np.ndarray, "c"]]:
    """Corners of each polygon, and the positions of all corners."""
    kind = primitive.tag
    if primitive.find("ph") is not None:
        raise checks.InputError("a polygon has a hole; cut it into triangles first")
    lists = [scenes.indices(element.text or "", kind) for element in primitive.findall("p")]
    for each in lists:
        if len(each) % stride:
            raise checks.InputError(f"{kind}: {len(each)} indices are no multiple of {stride}")
    strips = [each[offset::stride] for each in lists]
    if kind == "polygons":
        return np.array([len(each) for each in strips], dtype=np.int64), _joined(strips)
    primitives = len(strips)
    if kind in ("tristrips", "trifans"):
        cut = scenes.strip if kind == "tristrips" else _fan
        strips = [cut(each).reshape(-1) for each in strips]
    corners = _joined(strips)
    sizes = np.full(len(corners) // 3, 3)
    if kind == "polylist":
        sizes = scenes.indices(primitive.findtext("vcount", ""), "vcount")
    elif len(corners) % 3:
        raise checks.InputError(f"triangles: {len(corners)} corners are no multiple of three")
    primitives = len(sizes) if kind in ("polylist", "triangles") else primitives
    given = text.whole(primitive.get("count", str(primitives)).encode(), f"the count of {kind}")
    if sizes.sum() != len(corners) or given != primitives:
        claimed, there = f"{given} of them with {sizes.sum()} corners", f"{primitives} with {len(corners)} are there"
        raise checks.InputError(f"{kind}: the file claims {claimed}; {there}")
    return sizes, corners


def _joined(lists: list[Int[np.ndarray, "_"]]) -> Int[np.ndarray, "c"]:
    return np.concatenate([np.zeros(0, dtype=np.int64), *lists])


def _fan(index: Int[np.ndarray, "k"]) -> Int[np.ndarray, "c"]:
    return np.stack([np.full(max(len(index) - 2, 0), index[:1]), index[1:-1], index[2:]], axis=1).reshape(-1)

"""COLLADA 1.4 and 1.5 (DAE): the triangles of the scene, transforms and instances applied, coordinates as written.

Our own reader: trimesh passes over what pycollada does not know without a word, and fans concave polygons. Neither the
unit nor the up axis of the file is applied, as no other format's is: a remark names an up axis other than Y.
"""

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element, TreeBuilder

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry.formats import raw
from ddf.geometry.formats.scene_files import collada_geometry, parts, xml_text

_DEEPEST = 128  # nodes in nodes
_MOST = 50_000  # geometries placed
_VISITED = 300_000  # nodes and what they hold, each as often as it is used
_ELEMENTS = 2_000_000  # and attributes of a file: a tree of some hundred bytes each
_BOUND = 8  # controllers on controllers
_CHUNK = 1 << 20  # bytes
_UNREAD = ("lookat", "skew")


class _Tree(xml_text.Target):
    """All elements, without their namespaces, and those with an id by tag and id."""

    def __init__(self) -> None:
        self._builder, self._count = TreeBuilder(), 0
        self.data = self._builder.data
        self.ids = collada_geometry.Ids()

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        self._count += 1 + len(attributes)
        if self._count > _ELEMENTS:
            raise checks.InputError(f"its XML has more than {_ELEMENTS} elements and attributes")
        element = self._builder.start(tag.rpartition("}")[2], attributes)
        self.ids.add(element)

    def end(self, tag: str) -> None:
        """An element ends."""
        self._builder.end(tag.rpartition("}")[2])

    def finished(self) -> Element:
        """The root, once the text has ended."""
        return self._builder.close()


def parse(data: bytes) -> raw.Raw:
    """All triangles of the scene, in the order of its nodes.

    Raises:
      InputError: no COLLADA, more than 128 MiB, no scene, references to nothing or outside the file, a transform or a
        kind of geometry that is not read, nodes in a circle, more than 20 million triangles.
    """
    tree = _Tree()
    reader = xml_text.Reader(tree)
    for place in range(0, len(data), _CHUNK):
        reader.feed(data[place : place + _CHUNK])
    reader.finish()
    root = tree.finished()
    if root.tag != "COLLADA":
        raise checks.InputError(f"not a dae mesh: its root is {root.tag[:40]!a}, not COLLADA")
    remarks: dict[str, None] = {}
    up = root.findtext("asset/up_axis", "Y_UP").strip()
    if up != "Y_UP":
        remarks[f"its up axis is {ascii(up[:10])[1:-1]}; coordinates are as written, not turned"] = None
    found: list[parts.Part] = []
    total = 0
    made: dict[str, parts.Part] = {}
    for key, matrix in _placements(tree, root, remarks):
        if key not in made:
            made[key] = collada_geometry.triangles(_element(tree, key, "geometry"), tree.ids, remarks)
        total = parts.counted(total, len(made[key][1]))
        if len(found) >= _MOST:
            raise checks.InputError(f"the scene places more than {_MOST} geometries")
        found.append(parts.placed(*made[key], matrix))
    return parts.joined(found, tuple(remarks))


def _placements(tree: _Tree, root: Element, remarks: dict[str, None]) -> Iterator[tuple[str, Float[np.ndarray, "4 4"]]]:
    """Id and transform of every geometry of the scene."""
    chosen = root.find("scene/instance_visual_scene")
    scenes = root.findall("library_visual_scenes/visual_scene")
    if chosen is not None:
        scenes = [_element(tree, _url(chosen), "visual_scene")]
    if len(scenes) != 1:
        raise checks.InputError(f"the file names no scene and has {len(scenes)}")
    stack = [(node, np.eye(4), "", 0) for node in reversed(scenes[0].findall("node"))]
    visited = 0
    while stack:
        node, above, unread, depth = stack.pop()
        visited += 1 + len(node)
        if depth > _DEEPEST or visited > _VISITED:
            raise checks.InputError("its nodes form a circle, or are too many")
        matrix = above
        for child in node:
            with np.errstate(over="ignore", invalid="ignore"):
                matrix = matrix @ _transform(child)
            unread = child.tag if child.tag in _UNREAD else unread
        for child in node:
            if child.tag in ("instance_geometry", "instance_controller"):
                if unread:
                    raise checks.InputError(f"a node has a {unread}, which is not read; save it as a matrix")
                shape, bound = (_url(child), np.eye(4))
                if child.tag == "instance_controller":
                    shape, bound = _unskinned(tree, shape, remarks)
                yield shape, matrix @ bound
        inner = [child for child in node if child.tag == "node"]
        inner += [_element(tree, _url(child), "node") for child in node if child.tag == "instance_node"]
        stack += [(child, matrix, unread, depth + 1) for child in reversed(inner)]


def _transform(element: Element) -> Float[np.ndarray, "4 4"]:
    """The matrix of one transform of a node; the identity for any other element."""
    matrix = np.eye(4)
    if element.tag == "matrix":
        return _numbers(element, 16).reshape(4, 4)
    if element.tag == "translate":
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


def _unskinned(tree: _Tree, controller: str, remarks: dict[str, None]) -> tuple[str, Float[np.ndarray, "4 4"]]:
    """The geometry under skins and morphs, and the transform that binds it."""
    bound = np.eye(4)
    for _ in range(_BOUND):
        element = tree.ids.get(controller, "controller")
        if element is None:
            return controller, bound
        inner = element.find("skin")
        if inner is not None:
            remarks["skins are not applied: the mesh is read as modelled"] = None
            shape = inner.find("bind_shape_matrix")
            bound = bound if shape is None else bound @ _numbers(shape, 16).reshape(4, 4)
        else:
            remarks["morph targets are not applied"] = None
            inner = element.find("morph")
        controller = "" if inner is None else _reference(inner.get("source", ""))
    raise checks.InputError("its controllers form a circle, or are too many")


def _numbers(element: Element, count: int) -> Float[np.ndarray, "k"]:
    return parts.numbers(xml_text.numbers(element.text or "", element.tag).tolist(), count, element.tag)


def _url(element: Element) -> str:
    return _reference(element.get("url", ""))


def _reference(url: str) -> str:
    if not url.startswith("#"):
        raise checks.InputError(f"{url[:80]!a} points outside the file")
    return url[1:]


def _element(tree: _Tree, key: str, tag: str) -> Element:
    found = tree.ids.get(key, tag)
    if found is None:
        raise checks.InputError(f"there is no {tag} {key[:40]!a}")
    return found

"""3MF: a ZIP file of XML parts; the objects that the build lists, components and transforms applied, as written.

Our own reader: trimesh reads the meshes of a part twice, volumes of slicers that are none, and archives of any size.
Coordinates are the file's (millimetres unless it says another unit); an object that is not built is not read.
"""

import io
import posixpath
import re
import struct
import urllib.parse
import zipfile
import zlib
from array import array
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry.formats import raw, scenes, text

_CORES = re.compile(r"\{http://schemas\.microsoft\.com/3dmanufacturing/(?:core/2015/02|2013/01)\}(\w+)")
_PRODUCTION = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}"
_RELATION = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_READ = ("/core/", "/production/", "/material/")  # of required extensions
_UNREAD = ("}beamlattice", "}slicestack", "}booleanshape", "}levelset", "}displacementmesh")
# what zipfile raises on damaged and encrypted archives
_DAMAGED = (zipfile.BadZipFile, zlib.error, struct.error, EOFError, OSError, RuntimeError, ValueError, LookupError)
_CHUNK = 1 << 20  # bytes
_DEEPEST = 64  # components in components
_MOST = 100_000  # objects placed, and objects and components there are
_ENTRIES = 10_000  # of the archive
_SUPPORTS = ("support", "solidsupport")  # types of objects that are printed beside the shape
_SLICERS = ("metadata/slic3r_pe_model.config", "metadata/model_settings.config")  # PrusaSlicer's; Bambu's and Orca's
_NO_SHAPE = re.compile(rb'"volume_type"\s+value="(?!ModelPart")|"modifier"\s+value="1"|subtype="(?!normal_part")')
_Reference = tuple[str, str, Float[np.ndarray, "4 4"]]  # file, id and transform of an object
_Told = TypeVar("_Told", bound=scenes.Target)


@dataclass
class _Object:
    """vertices, corners: of its own mesh. components: the objects that it is made of."""

    vertices: array = field(default_factory=lambda: array("d"))
    corners: array = field(default_factory=lambda: array("q"))
    components: list[_Reference] = field(default_factory=list)


class _Model(scenes.Target):
    """One part of the archive: its objects by id, and what it builds."""

    def __init__(self, place: str) -> None:
        self.objects: dict[str, _Object] = {}
        self.built: list[_Reference] = []
        self.unit, self.unread = "millimeter", set[str]()
        self._place, self._object, self._num_parts = place, _Object(), 0
        self._prefixes: dict[str, str] = {}

    def start_ns(self, prefix: str, uri: str) -> None:
        """A namespace gets a prefix."""
        self._prefixes[prefix or ""] = uri

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        core = _CORES.fullmatch(tag)
        name = core[1] if core else ""
        if tag.endswith(_UNREAD):
            self.unread.add(tag.rpartition("}")[2])
        elif name == "vertex":
            for axis in ("x", "y", "z"):
                self._object.vertices.append(text.number(_given(attributes, axis, name), "a vertex's coordinate"))
        elif name == "triangle":
            for axis in ("v1", "v2", "v3"):
                self._object.corners.append(text.whole(_given(attributes, axis, name), "an index of a triangle"))
        elif name == "object":
            self._count()
            self._object = _Object()
            is_support = attributes.get("type") in _SUPPORTS
            self.objects[_given(attributes, "id", name).decode()] = _Object() if is_support else self._object
            self.unread |= {"support"} if is_support else set()
        elif name == "component":
            self._object.components.append(self._reference(attributes, name))
        elif name == "item":
            self.built.append(self._reference(attributes, name))
        elif name == "model":
            self.unit = attributes.get("unit", "millimeter")
            for prefix in attributes.get("requiredextensions", "").split():
                uri = self._prefixes.get(prefix, prefix)
                if not any(part in uri for part in _READ):
                    raise checks.InputError(f"the file requires the extension {uri[:80]!a}, which is not read")

    def end(self, tag: str) -> None:
        """An element ends."""
        if tag.endswith("}object"):
            self._object = _Object()

    def _count(self) -> None:
        self._num_parts += 1
        if self._num_parts > _MOST:
            raise checks.InputError(f"it has more than {_MOST} objects and components")

    def _reference(self, attributes: dict[str, str], name: str) -> _Reference:
        self._count()
        matrix, words = np.eye(4), attributes.get("transform")
        if words is not None:  # four rows of three, that act on rows: x -> x M
            numbers = scenes.numbers(scenes.decimals(words, "a transform").tolist(), 12, "transform")
            matrix[:3] = numbers.reshape(4, 3).T
        place = attributes.get(f"{_PRODUCTION}path", self._place)
        return _part_name(place), _given(attributes, "objectid", name).decode(), matrix


class _Relations(scenes.Target):
    """Of the package: the part that is its model."""

    model = "3d/3dmodel.model"

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        if tag.endswith("}Relationship") and attributes.get("Type") == _RELATION:
            self.model = _part_name(attributes.get("Target", ""))


def _given(attributes: dict[str, str], name: str, element: str) -> bytes:
    if name not in attributes:
        raise checks.InputError(f"a {element} has no {name}")
    return attributes[name].encode()


def _part_name(name: str) -> str:
    """A name in an OPC package as names are compared: percent signs decoded, slashes, small letters, from the root."""
    return posixpath.normpath(urllib.parse.unquote(name).replace("\\", "/")).lstrip("/").lower()


def parse(data: bytes) -> raw.Raw:
    """The triangles of all objects that the file builds, in its order.

    Raises:
      InputError: no ZIP, damaged or encrypted, a required extension that is not read, indices or references to
        nothing, volumes of a slicer that are no part, components in a circle, more than 128 MiB of XML or 20 million
        triangles.
    """
    if data.count(b"PK\1\2") > _ENTRIES:
        raise checks.InputError(f"its archive has more than {_ENTRIES} entries")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = {_part_name(name): name for name in archive.namelist()}
            start = _read(archive, names, "_rels/.rels", _Relations()).model
            for name in _SLICERS:
                if name in names and _NO_SHAPE.search(archive.open(names[name]).read(scenes.MAX_BYTES)):
                    raise checks.InputError(
                        "a slicer's negative, modifier or support volumes are not read; save the shape without them"
                    )
            models: dict[str, _Model] = {}
            waiting = [start]
            while waiting:
                place = waiting.pop()
                if place not in models:
                    if place not in names:
                        raise checks.InputError(f"not a 3mf mesh: the part {place[:80]!a} is not in the archive")
                    models[place] = _read(archive, names, place, _Model(place))
                    waiting += [p for each in models[place].objects.values() for p, _, _ in each.components]
                    waiting += [p for p, _, _ in models[place].built]
    except checks.InputError:
        raise
    except _DAMAGED as fault:
        raise checks.InputError(f"not a readable 3mf mesh: {' '.join(str(fault).split())[:80]}") from fault
    return _flattened(models, start)


def _read(archive: zipfile.ZipFile, names: dict[str, str], place: str, target: _Told) -> _Told:
    """The target, told of a part of the archive; as it is where there is no such part."""
    if place in names:
        with archive.open(names[place]) as part:
            scenes.read_xml(iter(lambda: part.read(_CHUNK), b""), target)
    return target


def _flattened(models: dict[str, _Model], start: str) -> raw.Raw:
    if len({model.unit for model in models.values()}) > 1:
        raise checks.InputError("its models have different units; save it in one")
    scene = scenes.Scene(_MOST)
    made: dict[tuple[str, str], scenes.Part] = {}
    num_placed = 0
    stack = [(item, np.eye(4), 0) for item in reversed(models[start].built)]
    while stack:
        (place, key, own), above, depth = stack.pop()
        shape = models[place].objects.get(key)
        if shape is None:
            raise checks.InputError(f"the build or a component names object {key[:40]!a}, which is not there")
        num_placed += 1
        if depth > _DEEPEST or num_placed > _MOST:
            raise checks.InputError(f"components of object {key[:40]!a} form a circle, or are too many")
        matrix = scenes.product(above, own)
        if (place, key) not in made:
            mesh = raw.of_polygons(shape.vertices, np.full(len(shape.corners) // 3, 3), shape.corners)
            made[place, key] = mesh.vertices, mesh.faces
        scene.require_room(len(made[place, key][1]))
        if len(made[place, key][1]):
            scene.place(made[place, key], matrix)
        stack += [(part, matrix, depth + 1) for part in reversed(shape.components)]
    for name in sorted({name for model in models.values() for name in model.unread}):
        scene.remarks[f"{name} elements are left out"] = None
    return scene.joined()

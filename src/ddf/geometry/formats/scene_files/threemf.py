"""3MF: a ZIP file of XML parts; the objects that the build lists, components and transforms applied, as written.

Our own reader: trimesh stops at the first bad number without a word, and unpacks archives of any size into memory.
Coordinates are the file's (millimetres unless it says another unit); an object that is not built is not read.
"""

import io
import posixpath
import re
import struct
import zipfile
import zlib
from array import array
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry.formats import raw, text
from ddf.geometry.formats.scene_files import parts, xml_text

_CORES = re.compile(r"\{http://schemas\.microsoft\.com/3dmanufacturing/(?:core/2015/02|2013/01)\}(\w+)")
_PRODUCTION = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}"
_RELATION = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_READ = ("/core/", "/production/", "/material/")  # of required extensions
_DAMAGED = (  # what zipfile raises on damaged and encrypted archives
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    OSError,
    RuntimeError,
    ValueError,
    LookupError,
)
_CHUNK = 1 << 20  # bytes
_DEEPEST = 64  # components in components
_MOST = 100_000  # objects placed, and objects and components there are
_WAITING = 1 << 18  # words
_TAGS = 100  # whose names are remembered
_ENTRIES = 10_000  # of the archive


@dataclass
class _Object:
    """vertices, corners: of its own mesh. components: file, id and transform of the objects that it is made of."""

    vertices: array = field(default_factory=lambda: array("d"))
    corners: array = field(default_factory=lambda: array("q"))
    components: list[tuple[str, str, Float[np.ndarray, "4 4"]]] = field(default_factory=list)
    places: list[str] = field(default_factory=list)  # words of vertices that are not numbers yet
    indices: list[str] = field(default_factory=list)

    def settle(self) -> None:
        """Turn the words into numbers, all at once.

        Raises:
          InputError: one of them is no number.
        """
        for words, numbers, whole in ((self.places, self.vertices, False), (self.indices, self.corners, True)):
            table = text.Blocks(b"").table(" ".join(words).encode(), whole)
            if table is not None and len(table.values) == len(words):
                numbers.frombytes(table.values.tobytes())
            else:
                read, kind = (text.whole, "an index of a triangle") if whole else (text.number, "a vertex's coordinate")
                numbers.extend(read(word.strip().encode(), kind) for word in words)
            words.clear()


class _Model(xml_text.Target):
    """One part of the archive: its objects by id, and what it builds."""

    def __init__(self, place: str) -> None:
        self.place, self.objects, self.built, self.unit = place, {}, [], "millimeter"
        self.unread: set[str] = set()
        self._object: _Object | None = None
        self._prefixes: dict[str, str] = {}
        self._names: dict[str, str] = {}
        self._num_parts = 0

    def start_ns(self, prefix: str, uri: str) -> None:
        """A namespace gets a prefix."""
        self._prefixes[prefix or ""] = uri

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """An element begins."""
        name = self._names.get(tag)
        if name is None:
            core = _CORES.fullmatch(tag)
            name = core[1] if core else ""
            self._names = {**self._names, tag: name} if len(self._names) < _TAGS else self._names
        if not name:
            if tag.endswith(("}beamlattice", "}slicestack", "}booleanshape", "}levelset", "}displacementmesh")):
                self.unread.add(tag.rpartition("}")[2])
            return
        if name == "vertex" and self._object is not None:
            self._object.places += _three(attributes, ("x", "y", "z"), name)
            if len(self._object.places) > _WAITING:
                self._object.settle()
        elif name == "triangle" and self._object is not None:
            self._object.indices += _three(attributes, ("v1", "v2", "v3"), name)
            if len(self._object.indices) > _WAITING:
                self._object.settle()
        elif name == "object":
            self._count()
            self._object = self.objects[_given(attributes, "id", name)] = _Object()
        elif name == "component" and self._object is not None:
            self._count()
            self._object.components.append(self._reference(attributes, name))
        elif name == "item":
            self._count()
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
            if self._object is not None:
                self._object.settle()
            self._object = None

    def _count(self) -> None:
        self._num_parts += 1
        if self._num_parts > _MOST:
            raise checks.InputError(f"it has more than {_MOST} objects and components")

    def _reference(self, attributes: dict[str, str], name: str) -> tuple[str, str, Float[np.ndarray, "4 4"]]:
        place = attributes.get(f"{_PRODUCTION}path", self.place)
        return place.lstrip("/").lower(), _given(attributes, "objectid", name), _transform(attributes.get("transform"))


def parse(data: bytes) -> raw.Raw:
    """The triangles of all objects that the file builds, in its order.

    Raises:
      InputError: no ZIP, damaged or encrypted, a required extension that is not read, indices or references to
        nothing, components in a circle, more than 128 MiB of XML or 20 million triangles.
    """
    if data.count(b"PK\1\2") > _ENTRIES:
        raise checks.InputError(f"its archive has more than {_ENTRIES} entries")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = {name.lstrip("/").lower(): name for name in archive.namelist()}
            start = _start(archive, names)
            models: dict[str, _Model] = {}
            waiting = [start]
            while waiting:
                place = waiting.pop()
                if place not in models:
                    models[place] = _model(archive, names, place)
                    waiting += [p for each in models[place].objects.values() for p, _, _ in each.components]
                    waiting += [p for p, _, _ in models[place].built]
    except checks.InputError:
        raise
    except _DAMAGED as fault:
        raise checks.InputError(f"not a readable 3mf mesh: {' '.join(str(fault).split())[:80]}") from fault
    return _flattened(models, start)


def _start(archive: zipfile.ZipFile, names: dict[str, str]) -> str:
    """The part that the package names as its model."""
    if "_rels/.rels" in names:
        with archive.open(names["_rels/.rels"]) as part:
            for relation in re.findall(rb"<[^<>]*Relationship\s[^<>]*>", part.read(_CHUNK)):
                target = re.search(rb"Target\s*=\s*[\"']([^\"']*)", relation)
                if _RELATION.encode() in relation and target:
                    return posixpath.normpath(target[1].decode("utf-8", "replace")).lstrip("/").lower()
    return "3d/3dmodel.model"


def _model(archive: zipfile.ZipFile, names: dict[str, str], place: str) -> _Model:
    if place not in names:
        raise checks.InputError(f"not a 3mf mesh: the part {place[:80]!a} is not in the archive")
    found = _Model(place)
    reader = xml_text.Reader(found)
    with archive.open(names[place]) as part:
        while block := part.read(_CHUNK):
            reader.feed(block)
    reader.finish()
    return found


def _flattened(models: dict[str, _Model], start: str) -> raw.Raw:
    if len({model.unit for model in models.values()}) > 1:
        raise checks.InputError("its models have different units; save it in one")
    found: list[parts.Part] = []
    made: dict[tuple[str, str], parts.Part] = {}
    total = num_placed = 0
    stack = [(item, np.eye(4), 0) for item in reversed(models[start].built)]
    while stack:
        (place, key, own), above, depth = stack.pop()
        shape = models[place].objects.get(key)
        if shape is None:
            raise checks.InputError(f"the build or a component names object {key[:40]!a}, which is not there")
        num_placed += 1
        if depth > _DEEPEST or num_placed > _MOST:
            raise checks.InputError(f"components of object {key[:40]!a} form a circle, or are too many")
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = above @ own
        if (place, key) not in made:
            own_mesh = raw.of_polygons(shape.vertices, [3] * (len(shape.corners) // 3), shape.corners)
            made[place, key] = own_mesh.vertices, own_mesh.faces
        total = parts.counted(total, len(made[place, key][1]))
        if len(made[place, key][1]):
            found.append(parts.placed(*made[place, key], matrix))
        stack += [(part, matrix, depth + 1) for part in reversed(shape.components)]
    unread = sorted({name for model in models.values() for name in model.unread})
    return parts.joined(found, [f"{name} elements are left out" for name in unread])


def _given(attributes: dict[str, str], name: str, element: str) -> str:
    if name not in attributes:
        raise checks.InputError(f"a {element} has no {name}")
    return attributes[name]


def _three(attributes: dict[str, str], names: tuple[str, str, str], element: str) -> tuple[str, str, str]:
    first, second, third = names
    try:
        return attributes[first], attributes[second], attributes[third]
    except KeyError as fault:
        raise checks.InputError(f"a {element} has no {fault.args[0]}") from fault


def _transform(words: str | None) -> Float[np.ndarray, "4 4"]:
    """Twelve numbers, four rows of three, that act on rows: x -> x M."""
    matrix = np.eye(4)
    if words is not None:
        matrix[:3] = parts.numbers(xml_text.numbers(words, "a transform").tolist(), 12, "transform").reshape(4, 3).T
    return matrix

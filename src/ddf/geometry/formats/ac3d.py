"""AC3D (.ac, and .acc of TORCS): objects within objects, each with its place; polygons and strips of triangles.

Lines, normals, crease angles and subdivision are not read. `surfaces` keeps what paints need, `parse` the shape alone.
"""

import io
import re
import shlex
from array import array
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.formats import raw, text

MAX_OBJECTS = 100_000
_LINES = (1, 2)  # types of a surface that are none: a closed line, a line
_STRIP = 4


class Material(NamedTuple):
    """Diffuse colour as it is shown, in [0, 1], and how much light passes through: 1 is invisible."""

    colour: tuple[float, float, float] = (0.8, 0.8, 0.8)
    clear: float = 0.0


class Surfaces(NamedTuple):
    """Polygons of a file in its frame, with what they wear.

    counts, material, texture: per polygon; numbers of materials and textures, -1 for none. corners, uvs: per corner.
    """

    vertices: Float[np.ndarray, "n 3"]
    counts: Int[np.ndarray, "p"]
    corners: Int[np.ndarray, "c"]
    uvs: Float[np.ndarray, "c 2"]
    material: Int[np.ndarray, "p"]
    texture: Int[np.ndarray, "p"]
    materials: tuple[Material, ...]
    textures: tuple[str, ...]
    remarks: tuple[str, ...] = ()


def parse(data: bytes) -> raw.Raw:
    """Vertices in float64 and triangles of an AC3D file."""
    found = surfaces(data)
    return raw.of_polygons(found.vertices, found.counts, found.corners, found.remarks, refuse=False)


def surfaces(data: bytes, without: re.Pattern[str] | None = None) -> Surfaces:
    """The polygons of an AC3D file with their materials, textures and texture coordinates; those of objects
    whose names match `without` are left out.
    """
    data = text.decoded(data)
    if not data.startswith(b"AC3D"):
        raise checks.InputError("not an AC3D file: it must begin with AC3D")
    return _Reading(data, without).all()


class _Reading:
    """The lines of a file, and what was read of them so far."""

    def __init__(self, data: bytes, without: re.Pattern[str] | None) -> None:
        self.without = without
        self.stream, self.number = io.BytesIO(data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")), 0
        self.vertices, self.uvs = array("d"), array("d")
        self.counts, self.corners, self.material, self.texture = (array("q") for _ in range(4))
        self.materials: list[Material] = []
        self.textures: dict[str, int] = {}

    def all(self) -> Surfaces:
        """Every object; an object with kids is followed by them, each in its frame."""
        open_kids: list[tuple[int, np.ndarray, np.ndarray]] = []  # how many are missing, their frame
        objects = 0
        while words := self.words():
            if words[0] == b"MATERIAL":
                self.materials.append(self._material(words))
            elif words[0] == b"OBJECT":
                objects += 1
                if objects > MAX_OBJECTS:
                    raise checks.InputError(f"more than {MAX_OBJECTS} objects")
                count, rotation, place = open_kids.pop() if open_kids else (1, np.eye(3), np.zeros(3))
                if count > 1:
                    open_kids.append((count - 1, rotation, place))
                kids, rotation, place = self._object(rotation, place)
                if kids:
                    open_kids.append((kids, rotation, place))
        missing = sum(count for count, *_ in open_kids)  # of many files, that are whole all the same
        vertices, uvs = (np.array(a, dtype=np.float64) for a in (self.vertices, self.uvs))
        whole = (self.counts, self.corners, self.material, self.texture)
        counts, corners, material, texture = (np.array(a, dtype=np.int64) for a in whole)
        return Surfaces(
            vertices.reshape(-1, 3),
            counts,
            corners,
            uvs.reshape(-1, 2),
            material,
            texture,
            tuple(self.materials),
            tuple(self.textures),
            (f"{missing} objects that it counts are not there",) if missing else (),
        )

    def words(self) -> list[bytes]:
        """The next line that is not blank, in words; none at the end."""
        for line in self.stream:
            self.number += 1
            if words := line.split():
                return words
        return []

    def _next(self) -> list[bytes]:
        words = self.words()
        if not words:
            raise checks.InputError(f"cut short at line {self.number}")
        return words

    def _numbers(self, words: list[bytes], count: int) -> list[float]:
        if len(words) < count:
            raise checks.InputError(f"line {self.number}: {count} numbers are needed; got {len(words)}")
        return [text.number(word, f"line {self.number}") for word in words[:count]]

    def _whole(self, word: bytes) -> int:
        return text.whole(word, f"line {self.number}")

    def _material(self, words: list[bytes]) -> Material:
        values: dict[bytes, Any] = {}
        for key, count in ((b"rgb", 3), (b"trans", 1)):
            if key in words:
                values[key] = self._numbers(words[words.index(key) + 1 :], count)
        colour = tuple(values.get(b"rgb", Material().colour))
        return Material((colour[0], colour[1], colour[2]), values.get(b"trans", [0.0])[0])

    def _object(self, rotation: np.ndarray, place: np.ndarray) -> tuple[int, np.ndarray, np.ndarray]:
        """One object, up to its number of kids; returns that and its frame: x -> x R + place."""
        first, texture, hidden = len(self.vertices) // 3, -1, False
        turn, moved = np.eye(3), np.zeros(3)
        scale, offset = [1.0, 1.0], [0.0, 0.0]
        while True:
            words = self._next()
            key = words[0]
            if key == b"kids":
                return self._whole(words[-1]), turn @ rotation, moved @ rotation + place
            if key == b"name":
                hidden = self.without is not None and bool(self.without.search(_quoted(b" ".join(words[1:]))))
            elif key == b"loc":
                moved = np.array(self._numbers(words[1:], 3))
            elif key == b"rot":
                turn = np.array(self._numbers(words[1:], 9)).reshape(3, 3)
            elif key == b"texrep":
                scale = self._numbers(words[1:], 2)
            elif key == b"texoff":
                offset = self._numbers(words[1:], 2)
            elif key == b"texture" and texture < 0:  # others of TORCS are for wear and shadows
                texture = self.textures.setdefault(_quoted(b" ".join(words[1:])), len(self.textures))
            elif key == b"data":  # any text of so many bytes
                self.number += self.stream.read(self._whole(words[-1])).count(b"\n")
            elif key == b"numvert":
                own = [self._numbers(self._next(), 3) for _ in range(self._whole(words[-1]))]
                matrix, shift = turn @ rotation, moved @ rotation + place
                placed = np.array(own, dtype=np.float64).reshape(-1, 3) @ matrix + shift
                self.vertices.frombytes(placed.tobytes())
            elif key == b"SURF":
                self._surface(words, first, texture, scale, offset, hidden)

    def _surface(
        self, words: list[bytes], first: int, texture: int, scale: list[float], offset: list[float], hidden: bool
    ) -> None:
        """One polygon, or the triangles of a strip; lines and what is hidden are passed over."""
        try:
            kind, material = int(words[1], 16) & 15, -1
        except (IndexError, ValueError) as fault:
            raise checks.InputError(f"line {self.number}: SURF must give its flags, as 0x10") from fault
        while (words := self._next())[0] != b"refs":
            if words[0] == b"mat":
                material = self._whole(words[-1])
        index, uvs = array("q"), []
        available = len(self.vertices) // 3 - first
        for _ in range(self._whole(words[-1])):
            words = self._next()
            corner = self._whole(words[0])
            if not 0 <= corner < available:
                raise checks.InputError(f"line {self.number}: vertex {corner} of an object that has {available}")
            index.append(first + corner)
            place = self._numbers(words[1:], 2) if len(words) > 2 else (0.0, 0.0)
            uvs.append([k * value + shift for k, value, shift in zip(scale, place, offset, strict=True)])
        if hidden or kind in _LINES:
            return
        strip = [[i, i + 1, i + 2] if i % 2 == 0 else [i + 1, i, i + 2] for i in range(len(index) - 2)]
        for polygon in strip if kind == _STRIP else [list(range(len(index)))]:
            self.counts.append(len(polygon))
            self.corners.extend(index[i] for i in polygon)
            self.uvs.extend(value for i in polygon for value in uvs[i])
            self.material.append(material if material < len(self.materials) else -1)
            self.texture.append(texture)


def _quoted(words: bytes) -> str:
    """The first word, or what stands in quotes."""
    line = words.decode("utf-8", "replace")
    try:
        return next(iter(shlex.split(line, posix=True)), "")
    except ValueError:
        return line.strip('"')

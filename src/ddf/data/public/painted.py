"""Meshes with what their makers painted: OBJ with MTL, AC3D, MD2; colours of materials, and textures.

The shape is that of `mesh_io`; here every triangle keeps its material, its picture and its places in that.
"""

import io
import posixpath
import re
import struct
import zipfile
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Float32, Int
from PIL import Image

from ddf.core import checks
from ddf.data.synthetic.palette import Picture
from ddf.data.synthetic.parts import Part
from ddf.geometry.formats import ac3d, polygons, raw
from ddf.geometry.formats.ac3d import Material, Surfaces

_HEADER = struct.Struct("<4s16i")
_SKIN, _FRAME = 64, 40  # bytes of a skin's path, and before the points of a frame


def md2_surfaces(data: bytes) -> Surfaces:
    """The triangles of a file in its frame, z up; coordinates are of 8 bits, skins lack the ending of their picture."""
    if len(data) < _HEADER.size or not data.startswith(b"IDP2"):
        raise checks.InputError("not an MD2 file: it must begin with IDP2")
    head = _HEADER.unpack_from(data)
    _, _, width, height, _, skins, points, places, count, _, _, skin, place, triangle, frame, *_ = head
    try:
        scale, origin = np.frombuffer(data, "<f4", 6, frame).reshape(2, 3).astype(np.float64)
        packed = np.frombuffer(data, "u1", 4 * points, frame + _FRAME).reshape(-1, 4)[:, :3]
        both = np.frombuffer(data, "<u2", 6 * count, triangle).reshape(-1, 2, 3)[:, :, ::-1]  # they run clockwise
        corners, at = both.transpose(1, 0, 2).reshape(2, -1).astype(np.int64)
        uvs = np.frombuffer(data, "<i2", 2 * places, place).reshape(-1, 2)[at] / (width, height)
    except (ValueError, IndexError) as error:
        raise checks.InputError(f"damaged MD2 file: {error}") from error
    if count and corners.max() >= points:
        raise checks.InputError("damaged MD2 file: a triangle uses a point that is not there")
    names = [data[skin : skin + _SKIN].split(b"\0")[0].decode("ascii", "replace").lstrip(".")][:skins]
    none, uvs = np.full(count, -1), uvs * (1, -1) + (0, 1)
    vertices, counts = packed * scale + origin, np.full(count, 3)
    return Surfaces(vertices, counts, corners, uvs, none, none + len(names), (), tuple(names))


LARGEST = 256  # pixels of a picture; views have 137
GAMMA = 2.2  # from colours as they are shown to linear ones
WHITE = np.float32(0.75)  # of the light is what white paint gives back, so that lamps from above do not bleach it
CLEAR = 0.95  # materials that let more light through are not seen: cones of lights
TURNING = re.compile(  # names of objects that stand for what moves: propellers in flight, vapour, parachutes
    r"pr(o?p|plr).*(fast|slow|dis[ck]|blur|turn)|disquehelice|condensation|chute$", re.IGNORECASE
)
_PIXELS = 64_000_000  # of a picture that is read

Read = Callable[[str], bytes | None]  # a file beside the mesh, by the path that the mesh gives


@dataclass(frozen=True)
class Painted:
    """Triangles, their linear colours, number of the picture (-1 for none) and places in it, v up."""

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    colours: Float32[np.ndarray, "m 3"]
    picture: Int[np.ndarray, "m"]
    uvs: Float32[np.ndarray, "m 3 2"]
    pictures: tuple[Picture, ...]

    def turned(self, frame: Float[np.ndarray, "3 3"]) -> "Painted":
        """The mesh after a linear map; one that mirrors winds it outwards again."""
        mirrors = np.linalg.det(frame) < 0
        faces, uvs = (self.faces[:, ::-1], self.uvs[:, ::-1]) if mirrors else (self.faces, self.uvs)
        return replace(self, vertices=self.vertices @ frame.T, faces=faces, uvs=uvs)

    def joined(self, items: Sequence[Part]) -> "Painted":
        """The mesh and some parts."""
        mesh = self
        for part in items:
            count = len(part.triangles)
            mesh = replace(
                mesh,
                vertices=np.concatenate([mesh.vertices, part.vertices]),
                faces=np.concatenate([mesh.faces, part.triangles + len(mesh.vertices)]),
                colours=np.concatenate([mesh.colours, np.full((count, 3), part.paint.colour, dtype=np.float32)]),
                picture=np.concatenate([mesh.picture, np.full(count, -1)]),
                uvs=np.concatenate([mesh.uvs, np.zeros((count, 3, 2), dtype=np.float32)]),
            )
        return mesh


def load(archive: zipfile.ZipFile, path: str, looks: str = "") -> Painted:
    """A mesh of a kept archive; `looks`: a folder of it with pictures that are not beside the mesh, ending in /."""
    folder = posixpath.dirname(path)

    def beside(name: str) -> bytes | None:
        own = posixpath.basename(name.replace("\\", "/"))
        places = (posixpath.join(folder, name), posixpath.join(folder, own), looks + own)
        named = (place + ending for ending in ("", ".png", ".jpg") for place in places)  # of skins without one
        return next((archive.read(place) for place in named if place in archive.NameToInfo), None)

    try:
        data = archive.read(path)
        read = {".obj": lambda: obj_surfaces(data, beside), ".md2": lambda: md2_surfaces(data)}
        found = read.get(path[-4:], lambda: ac3d.surfaces(data, TURNING))()
        return paint(found, beside)
    except (zipfile.BadZipFile, KeyError, checks.InputError) as error:
        raise checks.InputError(f"{archive.filename}: {path}: {error}") from error


def paint(found: Surfaces, beside: Read) -> Painted:
    """The triangles of polygons in their paints, those that are not seen left out."""
    seen = found.counts >= 3
    seen &= np.array([*(m.clear < CLEAR for m in found.materials), True])[found.material]
    kept = np.repeat(seen, found.counts)
    corners, uvs, counts = found.corners[kept], found.uvs[kept], found.counts[seen]
    raw.require_coordinates(found.vertices)
    own, _ = polygons.triangulate(found.vertices[corners], counts, np.arange(len(corners)), refuse=False)
    of = np.repeat(np.flatnonzero(seen), counts - 2)
    opened = [_picture(beside(name)) for name in found.textures]
    pictures = tuple(picture for picture in opened if picture is not None)
    numbers = np.array([-1 if p is None else pictures.index(p) for p in opened] + [-1])
    colours = np.array([*(m.colour for m in found.materials), Material().colour], dtype=np.float32)
    faces = corners[own]
    if not len(faces):
        raise checks.InputError("no triangles found")
    linear = WHITE * np.clip(colours[found.material[of]], 0, 1) ** np.float32(GAMMA)
    return Painted(found.vertices, faces, linear, numbers[found.texture[of]], uvs[own].astype(np.float32), pictures)


def _picture(data: bytes | None) -> Picture | None:
    """A texture, made small; None where it is missing or no picture."""
    if data is None:
        return None
    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.width * image.height > _PIXELS:
                return None
            image.draft("RGB", (LARGEST, LARGEST))
            shown = image.convert("RGBA").convert("RGB")
            shown.thumbnail((LARGEST, LARGEST), Image.Resampling.BOX)
            return Picture.of(WHITE * (np.asarray(shown, dtype=np.float32) / 255) ** np.float32(GAMMA))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        return None


def obj_surfaces(data: bytes, beside: Read) -> Surfaces:
    """The polygons of a plain OBJ file with the materials of its MTL files."""
    vertices, places = array("d"), array("d")
    counts, corners, at, material = (array("q") for _ in range(4))
    known: dict[str, int] = {}
    materials: list[tuple[Material, str]] = []
    current = -1
    for line in data.decode("utf-8", "replace").splitlines():
        words = line.split()
        match words:
            case ["v", *numbers]:
                vertices.extend(map(float, numbers[:3]))
            case ["vt", *numbers]:
                places.extend(map(float, (*numbers[:2], 0.0)[:2]))
            case ["f", *fields]:
                for field in fields:
                    vertex, _, rest = field.partition("/")
                    place = rest.partition("/")[0]
                    corners.append(_index(vertex, len(vertices) // 3))
                    at.append(_index(place, len(places) // 2) if place else -1)
                counts.append(len(fields))
                material.append(current)
            case ["usemtl", *names]:
                current = known.get(" ".join(names), len(materials) - 1 if len(materials) == 1 else -1)
            case ["mtllib", *names]:
                for name, entry in _mtl(beside(" ".join(names)) or b"").items():
                    known.setdefault(name, len(materials))
                    materials.append(entry)
    textures = list(dict.fromkeys(name for _, name in materials if name))
    worn = np.array([*(textures.index(name) if name else -1 for _, name in materials), -1])
    numbers, index = np.array(material, dtype=np.int64), np.array(corners, dtype=np.int64)
    if len(index) and not 0 <= index.min() <= index.max() < len(vertices) // 3:
        raise checks.InputError("a face uses a vertex that is not there")
    uvs = np.array([*places, 0.0, 0.0]).reshape(-1, 2)
    return Surfaces(
        np.array(vertices).reshape(-1, 3),
        np.array(counts, dtype=np.int64),
        index,
        uvs[np.clip(np.array(at, dtype=np.int64), -1, len(uvs) - 1)],
        numbers,
        worn[numbers],
        tuple(own for own, _ in materials),
        tuple(textures),
    )


def _index(word: str, known: int) -> int:
    number = int(word)
    return number - 1 if number > 0 else known + number


def _mtl(data: bytes) -> Mapping[str, tuple[Material, str]]:
    """Materials by name, each with its texture; what is not understood stays as it is by default."""
    found: dict[str, tuple[Material, str]] = {}
    name = ""
    for line in data.decode("utf-8", "replace").splitlines():
        words = line.split()
        own, texture = found.get(name, (Material(), ""))
        match words:
            case ["newmtl", *names]:
                name = " ".join(names)
                found[name] = (Material(), "")
            case ["Kd", red, green, blue]:
                found[name] = (own._replace(colour=(float(red), float(green), float(blue))), texture)
            case ["d", value]:
                found[name] = (own._replace(clear=1 - float(value)), texture)
            case ["map_Kd", *_, file]:
                found[name] = (own, file)
    return found

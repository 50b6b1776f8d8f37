"""Small meshes and rays for the geometry tests; small Debian packages of shapes, made by hand."""

import hashlib
import io
import tarfile
import zipfile
from typing import Literal

import numpy as np
import torch
import trimesh
from PIL import Image

from ddf.data.public import manifest, packages
from ddf.geometry import mesh_io, rays

BLOCK = "".join(f"v {x} {y} {z}\n" for x in (0, 2) for y in (0, 1) for z in (0, 1))
FACES = "f 1/1 2/2 4/3 3/4\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
OBJ = f"mtllib a.mtl\n{BLOCK}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl wood\n{FACES}"
MTL = "newmtl wood\nKd 1 0.5 0\nmap_Kd wood.png\n"

UNIT_CUBE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
QUADS = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]  # its sides, outwards


def area_and_volume(mesh: mesh_io.Mesh) -> tuple[float, float]:
    """Of the triangles, and of what they enclose if they are closed and face outwards."""
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    cross = np.cross(b - a, c - a)
    return float(np.linalg.norm(cross, axis=1).sum() / 2), float(np.einsum("ij,ij->", a, cross) / 6)


def icosphere(level: int, radius: float = 1.0) -> mesh_io.Mesh:
    """Subdivided icosahedron with its corners on the sphere."""
    shape = trimesh.creation.icosphere(subdivisions=level, radius=radius)
    return mesh_io.Mesh(np.array(shape.vertices), np.array(shape.faces))


def cube(half: float = 1.0) -> mesh_io.Mesh:
    """The surface of [-half, half]^3, 12 triangles, wound outwards."""
    shape = trimesh.creation.box(extents=(2 * half,) * 3)
    return mesh_io.Mesh(np.array(shape.vertices), np.array(shape.faces))


def torus(major: float = 0.7, minor: float = 0.3, sections: int = 48) -> mesh_io.Mesh:
    """A torus around the y axis."""
    shape = trimesh.creation.torus(major, minor, major_sections=sections, minor_sections=sections)
    vertices = np.array(shape.vertices)[:, [0, 2, 1]]
    return mesh_io.Mesh(vertices, np.array(shape.faces)[:, ::-1])


def sheet(steps: int) -> mesh_io.Mesh:
    """A flat open grid of so many by so many vertices on [0, 1]² in the plane z = 0."""
    x, y = (g.ravel() for g in np.meshgrid(np.linspace(0, 1, steps), np.linspace(0, 1, steps)))
    index = np.arange(steps * steps).reshape(steps, steps)
    a, b, c, d = (i.ravel() for i in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    return mesh_io.Mesh(np.stack([x, y, 0 * x], 1), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def joined(*parts: mesh_io.Mesh) -> mesh_io.Mesh:
    """Several meshes as one soup."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + offset for part, offset in zip(parts, offsets, strict=True)]
    return mesh_io.Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def moved(mesh: mesh_io.Mesh, scale: float | np.ndarray, shift: tuple[float, float, float]) -> mesh_io.Mesh:
    """The mesh scaled (along each axis), then shifted."""
    return mesh_io.Mesh(mesh.vertices * scale + np.array(shift), mesh.faces)


def float32(mesh: mesh_io.Mesh) -> mesh_io.Mesh:
    """As a GPU holds it."""
    return mesh_io.Mesh(mesh.vertices.astype(np.float32), mesh.faces)


def random_rays(count: int, seed: int, spread: float = 1.0) -> rays.OrientedPoints:
    """Positions uniform in a cube, directions uniform on the sphere."""
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return rays.OrientedPoints(torch.from_numpy(rng.uniform(-spread, spread, (count, 3))), torch.from_numpy(directions))


def towards(count: int, radius: float, spread: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Rays from a sphere of this radius to places around its centre."""
    rng = np.random.default_rng(seed)
    starts = rng.standard_normal((count, 3))
    starts *= radius / np.linalg.norm(starts, axis=1, keepdims=True)
    ways = rng.uniform(-spread, spread, (count, 3)) - starts
    return starts, ways / np.linalg.norm(ways, axis=1, keepdims=True)


def zipped(members):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def png(colour=(255, 0, 0)):
    buffer = io.BytesIO()
    Image.new("RGB", (4, 4), colour).save(buffer, "PNG")
    return buffer.getvalue()


def deb(members, name="data.tar.xz", mode: Literal["w", "w:xz"] = "w:xz"):
    """An ar archive as dpkg-deb makes it."""
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode=mode) as archive:
        for path, content in members.items():
            entry = tarfile.TarInfo(f"./{path}")
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    out = b"!<arch>\n"
    for own, content in (("debian-binary", b"2.0\n"), ("control.tar.xz", b"odd"), (name, data.getvalue())):
        head = f"{own:<16}{0:<12}{0:<6}{0:<6}{'100644':<8}{len(content):<10}`\n"
        out += head.encode() + content + b"\n" * (len(content) % 2)
    return out


def package(data, root="usr/share/pieces"):
    """What is pinned of a package's bytes."""
    return packages.Package("pieces", "1:2.0-1", len(data), hashlib.sha256(data).hexdigest(), root)


def keep_pieces(folder, monkeypatch, rows):
    """A manifest of these rows of `pieces`, whose package is kept; caches and own data are below the folder."""
    for name in ("XDG_CACHE_HOME", "XDG_DATA_HOME"):
        monkeypatch.setenv(name, str(folder / name))
    data = deb(pieces())
    monkeypatch.setattr(packages, "PACKAGES", {"pieces": package(data)})
    monkeypatch.setattr(manifest, "rows", lambda: rows)
    (folder / "p.deb").write_bytes(data)
    packages.keep(packages.PACKAGES["pieces"], manifest.wanted("pieces"), folder / "p.deb")


def pieces():
    """The members of a package with one textured chair in a nested archive, and files that nobody asked for."""
    inner = {"a/a.obj": OBJ, "a/a.mtl": MTL, "a/wood.png": png(), "a/notes.txt": "x", "b/b.obj": OBJ}
    return {
        "usr/share/pieces/Set.sh3f": zipped(inner),
        "usr/share/pieces/plane/Models/p.ac": b"AC3Db\n",
        "usr/share/pieces/plane/Liveries/red/p.png": png(),
        "usr/share/pieces/plane/Liveries/blue/p.png": png(),
        "usr/share/doc/pieces/copyright": b"free",
    }

"""Public shapes in the frame of ShapeNet v1, in their makers' paints, ready to be written and rendered."""

import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, Int

from ddf.core import checks, storage
from ddf.data import mesh_topology
from ddf.data.public import manifest, packages, painted
from ddf.data.synthetic import appearance, assemble, palette, parts, write
from ddf.data.synthetic.palette import Picture
from ddf.data.synthetic.parts import Part
from ddf.geometry import mesh_io

ACROSS = 120  # pixels of a view that the diagonal of a shape spans, about
STRETCH, TAPER = 0.2, 0.3  # of variations: logarithm of the factors, change of width from end to end
GLOSS, HARDNESS = 0.2, 32.0  # the files' own say little: most give a default


def turned(axes: str) -> Float[np.ndarray, "k 3"]:
    """The rotation whose rows are the axes of the file that become X (ahead), Y (up) and Z, those given: "z y -x"."""
    rows = [np.eye(3)["xyz".index(word[-1])] * (-1 if word[0] == "-" else 1) for word in axes.split()]
    return np.stack(rows)


def load(archive: zipfile.ZipFile, row: manifest.Row) -> painted.Painted:
    """The mesh of a row, turned to X ahead and Y up, on its wheels."""
    mesh = painted.load(archive, row.path, row.looks)
    return mesh.turned(turned(row.axes)).joined(_wheels(row.wheels))


def varied(mesh: painted.Painted, rng: np.random.Generator) -> painted.Painted:
    """A copy that differs as two makes of a thing do: stretched along the axes, mirrored or not, tapered along one."""
    frame = np.diag(np.exp(rng.uniform(-STRETCH, STRETCH, 3)) * [1, 1, rng.choice([-1, 1])])
    mesh = mesh.turned(frame)
    along, amount = rng.integers(3), rng.uniform(-TAPER, TAPER)
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    share = (mesh.vertices[:, along] - lower[along]) / (upper[along] - lower[along]) - 0.5
    across = np.where(np.arange(3) == along, 0.0, amount)
    middle = (lower + upper) / 2
    return replace(mesh, vertices=middle + (mesh.vertices - middle) * (1 + share[:, None] * across))


def write_shape(root: Path, seed: int, kept: Path, row: manifest.Row, copy: int, num_views: int) -> list[Path]:
    """Write a shape of an archive, or a folder of own ones (copy 0), or a variation, as `synthetic.write` its own;
    InputError where an own mesh is not as `ddf shapes add` wrote it.
    """
    name, path = copy_id(row, copy), kept / row.path
    if row.package == manifest.OWN:
        if not path.is_file() or storage.checksum(path) != row.checksum:
            raise checks.InputError(f"{path}: gone, or changed since it was written; call `ddf shapes add {kept}`")
        mesh = plain(mesh_io.load(path))
    else:
        with packages.reading(kept) as archive:
            mesh = load(archive, row)
    if copy:
        mesh = varied(mesh, write.generator(seed, row.category, name, "mesh"))
    look = write.generator(seed, row.category, name, "look")
    made = _dressed(shape(mesh), look) if row.package == manifest.OWN else shape(mesh)
    return write.write_files(root, row.category, name, made, write.make_views(seed, row.category, name, num_views))


def plain(mesh: mesh_io.Mesh) -> painted.Painted:
    """A mesh in grey."""
    count = len(mesh.faces)
    grey, places = np.full((count, 3), 0.5, dtype=np.float32), np.zeros((count, 3, 2), dtype=np.float32)
    return painted.Painted(mesh.vertices, mesh.faces, grey, np.full(count, -1), places, ())


def _dressed(bare: assemble.Shape, rng: np.random.Generator) -> assemble.Shape:
    """The shape in paints and patterns of procedural shapes, each piece in one of three."""
    piece = mesh_topology.components(mesh_io.Mesh(bare.vertices, bare.triangles))[bare.triangles[:, 0]]
    worn = rng.integers(3, size=piece.max() + 1)[piece]
    given = enumerate((palette.cloth(rng), palette.wood(rng), palette.metal(rng)))
    items = [Part(bare.vertices, bare.triangles[worn == number], paint, str(number)) for number, paint in given]
    paints = [part.paint for part in appearance.dress(items, "", rng)]
    return replace(bare, **assemble.worn(paints, worn), covering=None)


def copy_id(row: manifest.Row, copy: int) -> str:
    """The id of a shape, or of one of its variations, from 1."""
    return f"{row.id}--{copy}" if copy else row.id


def _wheels(axles: Sequence[tuple[float, ...]]) -> list[Part]:
    """Tyres with rims, of axles given as (x, y, z, radius, width): z is to the middle of a wheel."""
    found = []
    for x, y, z, radius, width in axles:
        tyre = parts.lathe(parts.disc_profile(radius, width / 2, radius * 0.06), palette.TYRE, sides=24, axis="z")
        rim = parts.lathe(parts.disc_profile(radius * 0.62, width * 0.51), palette.CHROME, sides=16, axis="z")
        found += [part.moved(x, y, z) for part in (tyre, rim)]
    return parts.both_sides(found)


def shape(mesh: painted.Painted) -> assemble.Shape:
    """A painted mesh in the frame of ShapeNet v1: its triangles with an area, centred at 0, diagonal 1."""
    kept = _areas(mesh.vertices[mesh.faces]) > 1e-14 * np.ptp(mesh.vertices, axis=0).max() ** 2
    used, faces = np.unique(mesh.faces[kept], return_inverse=True)
    vertices, faces = assemble.normalise(mesh.vertices[used]), faces.reshape(-1, 3)
    _, first, same = np.unique(vertices, axis=0, return_index=True, return_inverse=True)  # seams of pictures
    count = len(faces)
    return assemble.Shape(
        vertices,
        faces,
        assemble.corner_normals(vertices, first[same.ravel()][faces]),
        mesh.colours[kept],
        np.full(count, GLOSS, dtype=np.float32),
        np.full(count, HARDNESS, dtype=np.float32),
        (("shape", count),),
        (),
        np.full(count, -1),
        _covering(mesh.pictures, mesh.picture[kept], mesh.uvs[kept], _areas(vertices[faces])),
    )


def _areas(corners: Float[np.ndarray, "m 3 k"]) -> Float[np.ndarray, "m"]:
    """Twice the areas of triangles, in space or in a picture."""
    across, along = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    if corners.shape[2] == 2:
        return np.abs(across[:, 0] * along[:, 1] - across[:, 1] * along[:, 0])
    return np.linalg.norm(np.cross(across, along), axis=1)


def _covering(
    pictures: tuple[Picture, ...], number: Int[np.ndarray, "m"], uvs: Float32[np.ndarray, "m 3 2"], areas: np.ndarray
) -> assemble.Covering:
    """The pictures, each triangle at the level where a pixel of it covers about one of a view."""
    sizes = np.array([*(picture.levels[0][..., 0].size for picture in pictures), 0])[number]
    per_pixel = sizes * _areas(uvs) / np.maximum(areas * ACROSS**2, 1e-12)
    level = np.rint(0.5 * np.log2(np.maximum(per_pixel, 1))).astype(int)
    return assemble.Covering(pictures, number, uvs, level)

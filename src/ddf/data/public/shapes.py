"""Public shapes in the frame of ShapeNet v1, in their makers' paints, ready to be written and rendered."""

import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, Int

from ddf.data.public import manifest, packages, painted
from ddf.data.synthetic import assemble, palette, parts, write
from ddf.data.synthetic.palette import Picture
from ddf.data.synthetic.parts import Part

ACROSS = 120  # pixels of a view that the diagonal of a shape spans, about
STRETCH, TAPER = 0.2, 0.3  # of variations: logarithm of the factors, change of width from end to end
GLOSS, HARDNESS = 0.2, 32.0  # the files' own say little: most give a default


def turned(axes: str) -> Float[np.ndarray, "3 3"]:
    """The rotation whose rows are the axes of the file that become X (ahead), Y (up) and Z: "z y -x"."""
    rows = [np.eye(3)["xyz".index(word[-1])] * (-1 if word[0] == "-" else 1) for word in axes.split()]
    return np.stack(rows)


def load(archive: zipfile.ZipFile, row: manifest.Row) -> painted.Painted:
    """The mesh of a row, turned to X ahead and Y up, on its wheels.

    Raises:
      InputError: as `painted.load`.
    """
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
    """Write a public shape of a kept archive (copy 0), or a variation of it, as `synthetic.write` writes its own."""
    name = copy_id(row, copy)
    with packages.reading(kept) as archive:
        mesh = load(archive, row)
    if copy:
        mesh = varied(mesh, write.generator(seed, row.category, name, "mesh"))
    return write.write_files(
        root, row.category, name, shape(mesh), write.make_views(seed, row.category, name, num_views)
    )


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

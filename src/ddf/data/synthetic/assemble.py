"""From parts to one mesh in the ShapeNet v1 frame, with the faults of collected models and the look for rendering."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int

from ddf.data.synthetic.palette import Paint, Picture, Texture
from ddf.data.synthetic.parts import Part

DECIMALS = 8  # of the written coordinates: a diagonal of 1 is then off by 2e-8 at most
CREASE_COS = float(np.cos(np.radians(38.0)))  # faces that meet at a smaller angle are shaded as one smooth surface

FLIPPED_SHARE = 0.35  # of the parts of a shape that is wound badly
EXPLODED_SHARE = 0.3  # of the parts: every triangle has its own three vertices
DOUBLED_SHARE = 0.12  # of the parts: every triangle is there twice, once per side


@dataclass(frozen=True)
class Shape:
    """A coloured triangle mesh, Y up, box centred at 0 with diagonal 1.

    vertices: as written to the OBJ file, rounded.
    normals: per triangle corner, unit, outwards where the parts are closed; triangles of zero area have zeros.
    colours, gloss, hardness: per triangle, from the paints.
    parts: (name, number of triangles), in the order of the triangles.
    textures: of the paints. texture: number of that of each triangle; -1 for none. covering: pictures over all that.
    """

    vertices: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "m 3"]
    normals: Float32[np.ndarray, "m 3 3"]
    colours: Float32[np.ndarray, "m 3"]
    gloss: Float32[np.ndarray, "m"]
    hardness: Float32[np.ndarray, "m"]
    parts: tuple[tuple[str, int], ...]
    textures: tuple[Texture, ...]
    texture: Int[np.ndarray, "m"]
    covering: "Covering | None" = None


@dataclass(frozen=True)
class Covering:
    """Pictures on a shape, in place of colours: the number of that of each triangle (-1 for none), where in it the
    corners lie, and the level of it whose pixels are about as large as those of a view.
    """

    pictures: tuple[Picture, ...]
    number: Int[np.ndarray, "m"]
    uvs: Float32[np.ndarray, "m 3 2"]
    level: Int[np.ndarray, "m"]


@dataclass(frozen=True)
class Piece:
    """A part with the normals of its triangles' corners."""

    part: Part
    normals: Float32[np.ndarray, "m 3 3"]


def shape(items: Sequence[Part], rng: np.random.Generator, crease_cos: float = CREASE_COS) -> Shape:
    """Normalise the parts to the v1 frame as one mesh and make it untidy; the surface itself stays as it is.

    Args:
      crease_cos: cosine of the angle from which an edge shows; 1 shades every face flat.
    """
    pieces = untidy([Piece(part, corner_normals(part.vertices, part.triangles, crease_cos)) for part in items], rng)
    offsets = np.cumsum([0] + [len(piece.part.vertices) for piece in pieces])
    triangles = np.concatenate([p.part.triangles + offset for p, offset in zip(pieces, offsets[:-1], strict=True)])
    counts = [len(piece.part.triangles) for piece in pieces]
    return Shape(
        normalise(np.concatenate([piece.part.vertices for piece in pieces])),
        triangles,
        np.concatenate([piece.normals for piece in pieces]),
        parts=tuple((piece.part.name, count) for piece, count in zip(pieces, counts, strict=True)),
        **worn([piece.part.paint for piece in pieces], np.repeat(np.arange(len(pieces)), counts)),
    )


def worn(paints: Sequence[Paint], number: Int[np.ndarray, "m"]) -> dict[str, Any]:
    """Colours, gloss, hardness and textures of a `Shape` each of whose triangles wears the paint of that number."""
    textures = tuple(dict.fromkeys(paint.texture for paint in paints if paint.texture is not None))
    texture = np.array([-1 if paint.texture is None else textures.index(paint.texture) for paint in paints])
    colours = np.array([paint.colour for paint in paints], dtype=np.float32)
    gloss, hardness = np.array([(paint.gloss, paint.hardness) for paint in paints], dtype=np.float32).T
    looks = {"colours": colours, "gloss": gloss, "hardness": hardness, "texture": texture}
    return {name: values[number] for name, values in looks.items()} | {"textures": textures}


def normalise(vertices: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Centre the box at 0, make its diagonal 1, round to the decimals that are written."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    centred = (vertices - (lower + upper) / 2) / np.linalg.norm(upper - lower)
    return centred.round(DECIMALS) + 0.0  # + 0.0 turns -0.0 into 0.0


def untidy(pieces: Sequence[Piece], rng: np.random.Generator) -> list[Piece]:
    """Mixed winding between and within parts, unwelded triangles, doubled faces; nothing moves."""
    careless = rng.random() < 0.6
    speckled = rng.random() < 0.25
    result = []
    for piece in pieces:
        flip, explode, double = rng.random(3)
        if careless and flip < FLIPPED_SHARE:
            piece = _flip(piece, np.ones(len(piece.part.triangles), dtype=bool))
        if speckled:
            piece = _flip(piece, rng.random(len(piece.part.triangles)) < 0.1)
        if double < DOUBLED_SHARE:
            piece = _double(piece)
        result.append(_explode(piece) if explode < EXPLODED_SHARE else piece)
    return result


def _flip(piece: Piece, chosen: np.ndarray) -> Piece:
    """Reverse the winding of the chosen triangles."""
    triangles, normals = piece.part.triangles.copy(), piece.normals.copy()
    triangles[chosen] = triangles[chosen][:, ::-1]
    normals[chosen] = normals[chosen][:, ::-1]
    return Piece(replace(piece.part, triangles=triangles), normals)


def _double(piece: Piece) -> Piece:
    """Add every triangle again, wound the other way."""
    triangles = np.concatenate([piece.part.triangles, piece.part.triangles[:, ::-1]])
    return Piece(replace(piece.part, triangles=triangles), np.concatenate([piece.normals, piece.normals[:, ::-1]]))


def _explode(piece: Piece) -> Piece:
    """Give every triangle its own vertices."""
    vertices = piece.part.vertices[piece.part.triangles].reshape(-1, 3)
    return Piece(
        replace(piece.part, vertices=vertices, triangles=np.arange(len(vertices)).reshape(-1, 3)), piece.normals
    )


def corner_normals(
    vertices: Float[np.ndarray, "n 3"], triangles: Int[np.ndarray, "m 3"], crease_cos: float = CREASE_COS
) -> Float32[np.ndarray, "m 3 3"]:
    """Unit normals per triangle corner: area-weighted mean over the faces at that vertex within the crease angle."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    areas = np.cross(b - a, c - a)
    lengths = np.linalg.norm(areas, axis=1, keepdims=True)
    units = np.divide(areas, lengths, out=np.zeros_like(areas), where=lengths > 0)
    corner_vertex = triangles.ravel()
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex, minlength=len(vertices))
    starts = np.cumsum(counts) - counts
    degree = counts[corner_vertex]
    corner = np.repeat(np.arange(len(corner_vertex)), degree)  # every corner with every face at its vertex
    slot = np.arange(len(corner)) - np.repeat(np.cumsum(degree) - degree, degree)
    face = order[starts[corner_vertex[corner]] + slot] // 3
    keep = (units[corner // 3] * units[face]).sum(axis=1) >= crease_cos
    sums = np.stack(
        [np.bincount(corner[keep], areas[face[keep], k], minlength=len(corner_vertex)) for k in range(3)], axis=1
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    units = np.divide(sums, lengths, out=np.zeros_like(sums), where=lengths > 0)
    return units.reshape(-1, 3, 3).astype(np.float32)

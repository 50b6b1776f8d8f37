"""A rabbit's field: its oriented points, slices for three directions in space, and slices side by side.

[DDF22] fig. 1. Side by side: one direction for all points of a plane, planes of rising z.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from ddf.data.synthetic import showcase
from ddf.fields import framed_field
from ddf.fit import fit_folder, patch_fitting
from ddf.geometry import raycast, rays
from ddf.pictures import field_pictures, picture_strips, shaded
from ddf_lab.figures import drawing, figure_fields
from ddf_lab.report import beside, pages, shape_views

SHAPE = "rabbit"
LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the height of the box
SIDE = 460  # pixels of a panel
PLANES = (-0.75, -0.375, 0.0, 0.375, 0.75)  # z of the planes, of half the height of the box
_CAMERA, _ASIDE = (35.0, 20.0, 1.2), (28.0, 24.0, 1.6)
_POINTS, _FROM, _ARROW, _APART = 26, 1.05, 0.22, 1.9
_LONG = 0.75  # of the arrows of v


def teaser_section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Four panels."""
    on_ground, field = standing(), figure_fields.fitted(SHAPE, config, folder)
    directions = shape_views.DIRECTIONS
    names = ["oriented points (p, v)", *(f"d for v ∥ {shape_views.named(each)}" for each in directions)]
    cells = [points(on_ground, SIDE), *(slices(on_ground, field, each, SIDE) for each in directions)]
    row = picture_strips.StripRow(SHAPE, ("the points ask patches, the planes a network",), cells)
    figure = pages.Figure(
        "field.webp",
        "Left above: p and v of oriented points; blue ones see the rabbit, with d(p, v) in turquoise; black ones, with"
        " red arrows, see nothing: there ξ = 0. Others: one v (red) at all p of five planes; near is yellow, far is"
        " violet, clear grey sees nothing. The planes are drawn apart.",
        "Oriented points around a rabbit, and stacked slices of depth for three directions",
        picture_strips.strip(names, [row], per_line=2, side=SIDE),
    )
    return pages.Section("A directed distance field", [figure, "Answers [DDF22] fig. 1."])


def standing() -> shaded.Standing:
    """The patches of the shape in [-1, 1]³."""
    return shaded.stand(patch_fitting.patches(fit_folder.in_cube(showcase.SHAPES[SHAPE]())[0]))


def points(on_ground: shaded.Standing, size: int) -> picture_strips.Picture:
    """Oriented points around the shape, half of them looking at it."""
    random, away = np.random.default_rng(4), rays.evenly_spread(_POINTS)
    p = (_FROM + random.uniform(-0.15, 0.1, (_POINTS, 1))) * away
    corners = beside.corners(on_ground.field)
    towards = corners.mean(axis=0) + random.normal(0, 0.45, p.shape) - p
    v = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    depth = framed_field.query(on_ground.field, rays.OrientedPoints(p, v), ("depth",))[0]["depth"]
    seen = np.isfinite(depth)
    feet = np.array([[x, corners[0, 1], z] for x in corners[:, 0] for z in corners[:, 2]])
    drawn = drawing.Drawing.around(on_ground, _CAMERA, np.concatenate([p, p + _ARROW * v, feet]), size)
    hits = rays.surface_points(p[seen], v[seen], depth[seen])
    drawn.lines(p[seen], hits, drawing.SIGHT, 1.5)
    drawn.dots(hits, drawing.SIGHT, 3)
    drawn.looks(p, p + _ARROW * v, seen, 2.5, 5)
    return drawn.picture()


def slices(
    on_ground: shaded.Standing, field: framed_field.FramedField, direction: beside.Vector, size: int
) -> picture_strips.Picture:
    """Planes of rising z, drawn apart, coloured by d along one direction, which arrows show.

    Args:
      on_ground: of the shape in [-1, 1]³. field: of the mesh as it is.
    """
    _, own_from_mesh = fit_folder.in_cube(showcase.SHAPES[SHAPE]())
    v = np.array(direction) / np.linalg.norm(direction)
    to_mesh = own_from_mesh.inverse()
    low, high = own_from_mesh.apply(beside.corners(field))

    def depth(places: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        asked = rays.OrientedPoints(to_mesh.apply(places), to_mesh.apply_directions(np.tile(v, (len(places), 1))))
        return framed_field.query(field, asked, ("depth",))[0]["depth"]

    middle, half = (low + high) / 2, (high - low) / 2
    levels = [(middle[2] + _APART * each * half[2], middle[2] + each * half[2]) for each in PLANES]
    corners = np.array([[x, y, at] for x in (low[0], high[0]) for y in (low[1], high[1]) for at, _ in levels])
    starts = np.array([[high[0] + 0.12, low[1] + 0.3, at] for at, _ in levels[1::2]])
    ends = starts + _LONG * v
    drawn = drawing.Drawing.around(on_ground, _ASIDE, np.concatenate([corners, starts, ends]), size, shape=False)
    drawn.planes(levels, np.stack([low, high]), depth)
    drawn.arrows(starts, ends, drawing.MISSED, 3)
    return drawn.picture()


def slices_section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Two lines a direction, the field's and the exact one, and errors."""
    field, scene = figure_fields.fitted(SHAPE, config, folder), raycast.Scene(showcase.SHAPES[SHAPE]())
    strips, rows, scale = [], [], field.field_from_mesh.scale
    for direction in shape_views.DIRECTIONS:
        name = shape_views.named(direction)
        found = [shape_views.slice_of(field, scene, level, direction, config.picture_size) for level in LEVELS]
        squares = {kind: [beside.images(each)[kind] for each in found] for kind in ("depth", "true_depth")}
        pictures = field_pictures.depth_pictures(*squares["depth"], *squares["true_depth"])
        for what, cells in (("field", pictures[: len(LEVELS)]), ("exact", pictures[len(LEVELS) :])):
            strips.append(picture_strips.StripRow(f"v ∥ {name}", (what,), cells))
        off = beside.errors({kind: np.stack(each) for kind, each in squares.items()})
        median, mean = (f"{scale * off[key]:.4f}" for key in ("median", "mean"))
        rows.append([name, median, mean, f"{100 * off['wrong']:.1f}"])
    figure = pages.Figure(
        "depth_slices.webp",
        "Every pixel is a point p of a plane z = const, v is the same for all: near is yellow, far is violet, white"
        " sees nothing. d jumps to 0 where p moves through the surface.",
        "Slices of depth for three directions and five planes of rising z, beside the exact ones",
        picture_strips.strip([f"z at {100 * level:.0f} %" for level in LEVELS], strips, per_line=len(LEVELS)),
    )
    table = pages.Table(
        f"|d - exact| of the {SHAPE} over the pixels that both see (longest side about 2), and the share that only one"
        " sees.",
        ["v parallel to", "median", "mean", "visibility error, %"],
        rows,
    )
    return pages.Section("Slices of d", [figure, table, "Answers [DDF22] fig. 1, right."])

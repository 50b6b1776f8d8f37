"""A rabbit's field: its oriented points, slices for three directions in space, and slices side by side.

[DDF22] fig. 1. Side by side: one direction for all points of a plane, planes of rising z.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from ddf.data.synthetic import showcase
from ddf.fields import framed_field
from ddf.fit import fitting
from ddf.geometry import raycast, rays
from ddf.pictures import field_pictures, picture_strips, shaded
from ddf_lab.figures import drawing, figure_fields
from ddf_lab.report import pages, shape_views

SHAPE = "rabbit"
DIRECTIONS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0))  # of the paper's figure
LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the height of the box
SIDE = 460  # pixels of a panel
PLANES = (-0.75, -0.375, 0.0, 0.375, 0.75)  # z of the planes, of half the height of the box
_CAMERA, _ASIDE = (35.0, 20.0, 1.2), (28.0, 24.0, 1.6)
_POINTS, _FROM, _ARROW, _APART = 26, 1.05, 0.22, 1.9
_LONG = 0.75  # of the arrows of v


def teaser_section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Four panels."""
    on_ground = standing()
    field = figure_fields.fitted(SHAPE, config, folder)
    names = ["oriented points (p, v)", *(f"d for v ∥ {named(each)}" for each in DIRECTIONS)]
    cells = [points(on_ground, SIDE), *(slices(on_ground, field, each, SIDE) for each in DIRECTIONS)]
    return pages.Section(
        "A directed distance field",
        [
            pages.Figure(
                "field.webp",
                "Left above: p and v of oriented points; blue ones see the rabbit, with d(p, v) in turquoise; black"
                " ones, with red arrows, see nothing: there ξ = 0. Others: one v (red) at all p of five planes; near is"
                " yellow, far is violet, clear grey sees nothing. The planes are drawn apart.",
                "Oriented points around a rabbit, and stacked slices of depth for three directions",
                picture_strips.strip(
                    names,
                    [picture_strips.StripRow(SHAPE, ("the points ask patches, the planes a network",), cells)],
                    per_line=2,
                    side=SIDE,
                ),
            ),
            "Answers [DDF22] fig. 1.",
        ],
    )


def standing() -> shaded.Standing:
    """The patches of the shape in [-1, 1]³."""
    return shaded.stand(drawing.patches(fitting.in_cube(showcase.SHAPES[SHAPE]())[0]))


def points(on_ground: shaded.Standing, size: int) -> picture_strips.Picture:
    """Oriented points around the shape, half of them looking at it."""
    random, away = np.random.default_rng(4), rays.evenly_spread(_POINTS)
    p = (_FROM + random.uniform(-0.15, 0.1, (_POINTS, 1))) * away
    middle = (on_ground.field.lower + on_ground.field.upper) / 2
    towards = on_ground.field.field_from_mesh.inverse().apply(middle[None]) + random.normal(0, 0.45, p.shape) - p
    v = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    depth = framed_field.query(on_ground.field, rays.OrientedPoints(p, v), ("depth",))[0]["depth"]
    seen = np.isfinite(depth)
    drawn = drawing.Drawing.around(on_ground, _CAMERA, np.concatenate([p, p + _ARROW * v, _feet(on_ground)]), size)
    hits = rays.surface_points(p[seen], v[seen], depth[seen])
    drawn.lines(p[seen], hits, drawing.SIGHT, 1.5)
    drawn.dots(hits, drawing.SIGHT, 3)
    for chosen, dot, arrow in ((seen, drawing.HIT, drawing.LOOK), (~seen, drawing.MISS, drawing.MISSED)):
        drawn.arrows(p[chosen], (p + _ARROW * v)[chosen], arrow, 2.5)
        drawn.dots(p[chosen], dot, 5)
    return drawn.picture()


def slices(
    on_ground: shaded.Standing, field: framed_field.FramedField, direction: tuple[float, float, float], size: int
) -> picture_strips.Picture:
    """Planes of rising z, drawn apart, coloured by d along one direction, which arrows show.

    Args:
      on_ground: of the shape in [-1, 1]³. field: of the mesh as it is.
    """
    _, own_from_mesh = fitting.in_cube(showcase.SHAPES[SHAPE]())
    v = np.array(direction) / np.linalg.norm(direction)
    to_mesh = own_from_mesh.inverse()
    low, high = (
        own_from_mesh.apply(field.field_from_mesh.inverse().apply(each[None]))[0] for each in (field.lower, field.upper)
    )

    def depth(places: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        asked = rays.OrientedPoints(
            to_mesh.apply(places), np.broadcast_to(to_mesh.apply_directions(v[None])[0], places.shape)
        )
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


def _feet(on_ground: shaded.Standing) -> Float[np.ndarray, "4 3"]:
    """The lower corners of the box."""
    corners = on_ground.field.field_from_mesh.inverse().apply(np.stack([on_ground.field.lower, on_ground.field.upper]))
    return np.array([[x, corners[0, 1], z] for x in corners[:, 0] for z in corners[:, 2]])


def slices_section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Two lines a direction, the field's and the exact one, and errors."""
    field, scene = figure_fields.fitted(SHAPE, config, folder), raycast.Scene(showcase.SHAPES[SHAPE]())
    strips, rows = [], []
    for direction in DIRECTIONS:
        name = named(direction)
        slices = [shape_views.slice_images(field, scene, level, direction, config.picture_size) for level in LEVELS]
        depth, true = (np.stack([each[kind] for each in slices]) for kind in ("depth", "true_depth"))
        pictures = field_pictures.depth_pictures(*depth, *true)
        for what, cells in (("field", pictures[: len(LEVELS)]), ("exact", pictures[len(LEVELS) :])):
            strips.append(picture_strips.StripRow(f"v ∥ {name}", (what,), cells))
        both = np.isfinite(depth) & np.isfinite(true)
        off = np.abs(depth[both] - true[both])
        wrong = (np.isfinite(depth) != np.isfinite(true)).mean()
        rows.append([name, f"{np.median(off):.4f}", f"{off.mean():.4f}", f"{100 * wrong:.1f}"])
    columns = [f"z at {100 * level:.0f} %" for level in LEVELS]
    return pages.Section(
        "Slices of d",
        [
            pages.Figure(
                "depth_slices.webp",
                "Every pixel is a point p of a plane z = const, v is the same for all: near is yellow, far is violet,"
                " white sees nothing. d jumps to 0 where p moves through the surface.",
                "Slices of depth for three directions and five planes of rising z, beside the exact ones",
                picture_strips.strip(columns, strips, per_line=len(LEVELS)),
            ),
            pages.Table(
                f"|d - exact| of the {SHAPE} over the pixels that both see (longest side about 2), and the share that"
                " only one sees.",
                ["v parallel to", "median", "mean", "visibility error, %"],
                rows,
            ),
            "Answers [DDF22] fig. 1, right.",
        ],
    )


def named(direction: tuple[float, ...]) -> str:
    """As it stands above pictures."""
    return f"({', '.join(f'{part:g}' for part in direction)})"

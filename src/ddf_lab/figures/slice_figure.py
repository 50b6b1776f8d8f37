"""Slices of d: one direction for all points of a plane, planes of rising z. [DDF22] fig. 1, right."""

from pathlib import Path

import numpy as np

from ddf.data.synthetic import showcase
from ddf.geometry import raycast
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import pages, shape_views

SHAPE = "rabbit"
DIRECTIONS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0))  # of the paper's figure
LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the height of the box


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
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

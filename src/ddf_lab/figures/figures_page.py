"""The page of the figures: one section each, found in `SECTIONS`."""

from collections.abc import Callable
from pathlib import Path

from ddf_lab.figures import (
    distance_figure,
    figure_fields,
    fit_figure,
    room_figure,
    sample_figure,
    slice_figures,
    sphere_figures,
)
from ddf_lab.report import pages

SECTIONS: tuple[Callable[[figure_fields.FiguresConfig, Path], pages.Section], ...] = (
    slice_figures.teaser_section,
    sample_figure.section,
    slice_figures.slices_section,
    sphere_figures.section,
    fit_figure.section,
    room_figure.section,
    distance_figure.section,
)


def write(config: figure_fields.FiguresConfig, fields: Path, out: Path) -> None:
    """Make every section and write the page; `fields` is the folder of the fits, which are kept."""
    lead = (
        "Made by `make figures`. Shapes are our own; numbers are against exact values: closed forms, or rays cast and"
        " distances measured on the mesh that was fitted.",
        f"Fields: {config.steps:,} steps for two spheres and the room, {config.whole_steps:,} for the one field of the"
        " furnished room; the others come with the package (`ddf models`).",
    )
    page = pages.Page("The figures of the paper", [lead], [section(config, fields) for section in SECTIONS])
    pages.write(page, out)

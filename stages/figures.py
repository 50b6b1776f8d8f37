"""Stage `figures`: the paper's figures remade, with numbers against exact values, in artifacts/<experiment>/report."""

from ddf_lab.engine import stage
from ddf_lab.figures import (
    distance_figure,
    figure_fields,
    fit_figures,
    room_figure,
    sample_figure,
    slice_figures,
)
from ddf_lab.report import pages
from ddf_lab.run import Run

SECTIONS = (  # in the order of the page
    slice_figures.teaser_section,
    sample_figure.section,
    slice_figures.slices_section,
    fit_figures.spheres_section,
    fit_figures.shapes_section,
    room_figure.section,
    distance_figure.section,
)


@stage.main()
def make(run: Run) -> None:
    """Fit what is missing and write the page."""
    config, fields = run.section(figure_fields.FiguresConfig), run.folder("figures") / "fields"
    lead = (
        "Made by `make figures`. Shapes are our own; numbers are against exact values: closed forms, or rays cast and"
        " distances measured on the mesh that was fitted.",
        f"Fields: {config.steps:,} steps for two spheres and room; others are networks that `ddf models` lists.",
    )
    page = pages.Page("The figures of the paper", [lead], [section(config, fields) for section in SECTIONS])
    pages.write(page, run.page)

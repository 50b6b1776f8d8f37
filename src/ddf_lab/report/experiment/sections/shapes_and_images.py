"""Shape by shape, image by image: one model's error against the other's."""

import pandas as pd

from ddf_lab.evaluation import scoring
from ddf_lab.report import figures
from ddf_lab.report.experiment import seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Figure, Section

_POINTS = {  # file: columns of the table per image that make a point, what a point is
    "shapes.svg": (["id"], "A point is a test shape, the mean over its images."),
    "images.svg": (["id", "view"], "A point is a test image."),
}
_CAPTION = "{what} True camera, L points, logarithmic axes. Below the line DDF has the smaller D<sub>C</sub>."
_ALT = "points of the Chamfer distance of DDF over that of PC-SIREN around the diagonal, by category"


def section(results: Results) -> Section:
    """Two scatter plots."""
    blocks = []
    for name, (by, what) in _POINTS.items():
        values = {category: chamfer_pairs(results, category, by) for category in results.categories}
        drawn = figures.paired_scatter(values, "PC-SIREN, D_C × 1000", "DDF, D_C × 1000")
        caption = seed_notes.of_first(results, _CAPTION.format(what=what))
        blocks.append(Figure(name, caption, _ALT, drawn.encode()))
    return Section("Shape by shape, image by image", blocks)


def chamfer_pairs(results: Results, category: str, by: list[str]) -> figures.Samples:
    """D_C x 1000 of PC-SIREN and of DDF, true camera, L points.

    Args:
      by: columns of the table per image that make a point of the chart; of several images the mean is taken.
    """
    rows = results.per_image
    rows = rows[(rows["category"] == category) & (rows["column"] == "Pi_g-L")]
    by_method = {
        method: 1000.0 * rows[rows["method"] == method].groupby(by)["chamfer_l2_sq"].mean()
        for method in (scoring.PC_SIREN, scoring.DDF)
    }
    both = pd.concat(by_method, axis=1, join="inner")
    return both[scoring.PC_SIREN].to_numpy(), both[scoring.DDF].to_numpy()

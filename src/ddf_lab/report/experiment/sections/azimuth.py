"""Errors by azimuth: from where a shape is hard to see."""

import numpy as np
import pandas as pd

from ddf_lab.report import figures
from ddf_lab.report.experiment import seed_notes
from ddf_lab.report.experiment.sections import cameras
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Figure, Section

_CAPTION = (
    "Errors over the true azimuth of the camera. Left: of the shape (true camera, L points). Right: of the predicted "
    "camera."
)
_ALT = "Chamfer distances and azimuth errors of every test image over the azimuth of the camera, by category"
_READING = (
    "A point is a test image; a line is the median over one of {sectors} equal sectors.",
    "Logarithmic axes; values below 1/{range} of the largest are drawn there.",
)


def section(results: Results) -> Section:
    """One chart."""
    drawn = figures.medians_over_angle(over_azimuth(results), "true azimuth, degrees")
    picture = Figure("azimuth.svg", seed_notes.of_first(results, _CAPTION), _ALT, drawn.encode())
    values = {"sectors": figures.SECTORS, "range": figures.RANGE}
    return Section("Errors by azimuth", [picture, tuple(text.format(**values) for text in _READING)])


def over_azimuth(results: Results) -> list[tuple[str, dict[str, list[figures.AngleCurve]]]]:
    """Of every test image the errors of the shape (D_C x 1000, true camera, L points) and of the predicted camera."""
    chamfer: dict[str, list[figures.AngleCurve]] = {}
    azimuth: dict[str, list[figures.AngleCurve]] = {}
    placed = results.per_image[results.per_image["column"] == "Pi_g-L"]
    for category in results.categories:
        for name, method, column in cameras.PREDICTED:
            rows = results.camera_rows(category, method, column)
            if not len(rows):
                continue
            corrected = column == "Pi_corrected"
            azimuth.setdefault(category, []).append((name, method, corrected, _samples(rows, "azimuth_error_deg", 1.0)))
            if not corrected:
                rows = rows.merge(placed, on=["category", "method", "id", "view"])
                chamfer.setdefault(category, []).append((name, method, False, _samples(rows, "chamfer_l2_sq", 1000.0)))
    return [("D_C × 1000", chamfer), ("azimuth error, °", azimuth)]


def _samples(rows: pd.DataFrame, name: str, factor: float) -> figures.Samples:
    return rows["azimuth_deg"].to_numpy(dtype=np.float64), factor * rows[name].to_numpy(dtype=np.float64)

"""The charts of the report, from the tables of the evaluation."""

import numpy as np
import pandas as pd

from ddf.evaluation import baselines, scoring
from ddf.report import figures
from ddf.report.experiment import score_tables, stage_results

_BARS = {
    baselines.CEILING: "ceiling",
    baselines.ORACLE: "oracle retrieval",
    scoring.DDF: "DDF",
    scoring.PC_SIREN: "PC-SIREN",
    baselines.RETRIEVAL: "retrieval",
    baselines.MEAN_SHAPE: "mean shape",
}
_CAMERAS = (
    ("DDF", scoring.DDF, "Pi_pred"),
    ("DDF, corrected", scoring.DDF, "Pi_corrected"),
    ("PC-SIREN", scoring.PC_SIREN, "Pi_pred"),
)


def draw(results: stage_results.Results) -> dict[str, bytes]:
    """All charts as SVG by file name."""
    scores = score_tables.Scores(results.table, scoring.MEASURED)
    bars = {
        category: [
            (method, name, scores.value(category, (method, "Pi_g-L"), "f_score_tau_x100") or 0.0)
            for method, name in _BARS.items()
        ]
        for category in results.categories
    }
    charts = {
        "baselines.svg": figures.score_bars(bars, "F(τ) × 100, true camera, L"),
        "losses.svg": figures.loss_curves(results.logs),
        "images.svg": _scatter(pairs(results, ["id", "view"])),
        "shapes.svg": _scatter(pairs(results, ["id"])),
        "azimuth.svg": figures.medians_over_angle(over_azimuth(results), "true azimuth, degrees"),
        "cameras.svg": figures.cumulative_shares(camera_errors(results), "azimuth error, degrees", 180.0),
    }
    return {name: text.encode() for name, text in charts.items()}


def _scatter(values: dict[str, figures.Samples]) -> str:
    return figures.paired_scatter(values, "PC-SIREN, D_C × 1000", "DDF, D_C × 1000")


def pairs(results: stage_results.Results, by: list[str]) -> dict[str, figures.Samples]:
    """D_C x 1000 of PC-SIREN and of DDF, true camera, L points, by category.

    Args:
      by: columns of the table per image that make a point of the chart; of several images the mean is taken.
    """
    found = {}
    for category in results.categories:
        rows = results.per_image
        rows = rows[(rows["category"] == category) & (rows["column"] == "Pi_g-L")]
        by_method = {
            method: 1000.0 * rows[rows["method"] == method].groupby(by)["chamfer_l2_sq"].mean()
            for method in (scoring.PC_SIREN, scoring.DDF)
        }
        both = pd.concat(by_method, axis=1, join="inner")
        found[category] = (both[scoring.PC_SIREN].to_numpy(), both[scoring.DDF].to_numpy())
    return found


def camera_errors(results: stage_results.Results) -> dict[str, list[tuple[str, str, bool, np.ndarray]]]:
    """(name, method, whether corrected, azimuth errors) of every predicted camera, by category."""
    curves: dict[str, list[tuple[str, str, bool, np.ndarray]]] = {}
    for category in results.categories:
        for name, method, column in _CAMERAS:
            rows = results.cameras
            rows = rows[(rows["category"] == category) & (rows["method"] == method) & (rows["column"] == column)]
            if len(rows):
                errors = rows["azimuth_error_deg"].to_numpy(dtype=np.float64)
                curves.setdefault(category, []).append((name, method, column == "Pi_corrected", errors))
    return curves


def over_azimuth(results: stage_results.Results) -> list[tuple[str, dict[str, list[figures.AngleCurve]]]]:
    """Of every test image the errors of the shape (D_C x 1000, true camera, L points) and of the predicted camera."""
    chamfer: dict[str, list[figures.AngleCurve]] = {}
    azimuth: dict[str, list[figures.AngleCurve]] = {}
    scores = results.per_image[results.per_image["column"] == "Pi_g-L"]
    for category in results.categories:
        for name, method, column in _CAMERAS:
            rows = results.cameras
            rows = rows[(rows["category"] == category) & (rows["method"] == method) & (rows["column"] == column)]
            if not len(rows):
                continue
            corrected = column == "Pi_corrected"
            azimuth.setdefault(category, []).append((name, method, corrected, _samples(rows, "azimuth_error_deg", 1.0)))
            if not corrected:
                rows = rows.merge(scores, on=["category", "method", "id", "view"])
                chamfer.setdefault(category, []).append((name, method, False, _samples(rows, "chamfer_l2_sq", 1000.0)))
    return [("D_C × 1000", chamfer), ("azimuth error, degrees", azimuth)]


def _samples(rows: pd.DataFrame, name: str, factor: float) -> figures.Samples:
    return rows["azimuth_deg"].to_numpy(dtype=np.float64), factor * rows[name].to_numpy(dtype=np.float64)

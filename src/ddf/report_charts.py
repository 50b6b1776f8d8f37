"""The charts of the report, from the tables of the evaluation."""

import numpy as np
import pandas as pd

from ddf import baselines, evaluation, figures, report_inputs, report_tables

_BARS = {
    baselines.CEILING: "ceiling",
    baselines.ORACLE: "oracle retrieval",
    evaluation.DDF: "DDF",
    evaluation.PC_SIREN: "PC-SIREN",
    baselines.RETRIEVAL: "retrieval",
    baselines.MEAN_SHAPE: "mean shape",
}
_CAMERAS = (
    ("DDF", evaluation.DDF, "Pi_pred"),
    ("DDF, corrected", evaluation.DDF, "Pi_corrected"),
    ("PC-SIREN", evaluation.PC_SIREN, "Pi_pred"),
)


def draw(results: report_inputs.Results) -> dict[str, bytes]:
    """All charts as SVG by file name."""
    scores = report_tables.Scores(results.table, evaluation.MEASURED)
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
        "images.svg": figures.paired_scatter(pairs(results), "PC-SIREN, D_C × 1000", "DDF, D_C × 1000"),
        "cameras.svg": figures.cumulative_shares(camera_errors(results), "azimuth error, degrees", 180.0),
    }
    return {name: text.encode() for name, text in charts.items()}


def pairs(results: report_inputs.Results) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """D_C x 1000 of PC-SIREN and of DDF for the same images, true camera, L points, by category."""
    found = {}
    for category in results.categories:
        rows = results.per_image
        rows = rows[(rows["category"] == category) & (rows["column"] == "Pi_g-L")]
        by_method = {
            method: 1000.0 * rows[rows["method"] == method].set_index(["id", "view"])["chamfer_l2_sq"]
            for method in (evaluation.PC_SIREN, evaluation.DDF)
        }
        both = pd.concat(by_method, axis=1, join="inner")
        found[category] = (both[evaluation.PC_SIREN].to_numpy(), both[evaluation.DDF].to_numpy())
    return found


def camera_errors(results: report_inputs.Results) -> dict[str, list[tuple[str, str, bool, np.ndarray]]]:
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

"""Baselines and ceilings: what the numbers of the models mean."""

import math

from ddf.metrics import cloud_scores
from ddf_lab.evaluation import baselines, scoring
from ddf_lab.report import figures
from ddf_lab.report.experiment import scores, seed_notes
from ddf_lab.report.experiment.stage_results import Results
from ddf_lab.report.pages import Cell, Figure, Section, Table

ORDER = (
    baselines.CEILING,
    baselines.CEILING_VISIBLE,
    baselines.VISIBLE_AGAINST_ALL,
    baselines.ORACLE,
    scoring.DDF,
    scoring.PC_SIREN,
    baselines.RETRIEVAL,
    baselines.MEAN_SHAPE,
)
_COMPETITORS = (scoring.DDF, scoring.PC_SIREN, baselines.RETRIEVAL, baselines.MEAN_SHAPE)
_BARS = {
    baselines.CEILING: "ceiling",
    baselines.ORACLE: "oracle retrieval",
    scoring.DDF: "DDF",
    scoring.PC_SIREN: "PC-SIREN",
    baselines.RETRIEVAL: "retrieval",
    baselines.MEAN_SHAPE: "mean shape",
}
_COLUMNS = ("Pi_g-L", "Pi_g-S")
_BARS_CAPTION = "F-scores at the true camera, L points. Blue: DDF. Orange: PC-SIREN. Grey: no model."
_BARS_ALT = "bars of the F-scores of ceiling, oracle retrieval, DDF, PC-SIREN, retrieval and mean shape, by category"
_CAPTION = (
    "At the true camera. Bold: better than all others of both models, retrieval and the mean shape, by the rule of "
    "claims."
)
_READING = (
    "Ceiling: a random subset of the truth against all of it. No method does better with so many points.",
    "Visible points are those that some ray from outside meets first.",
    "Oracle retrieval knows the truth: it takes the training shape with the smallest D<sub>C</sub>.",
    "Retrieval takes the shape of the training image, of all that the encoder saw, whose feature is nearest.",
    "The mean shape is points of all training clouds together or one training shape, whichever is nearer to the "
    "validation shapes.",
)


def section(results: Results) -> Section:
    """Bars, and the table of all rows."""
    bars = Figure("baselines.svg", seed_notes.of_scores(results, _BARS_CAPTION), _BARS_ALT, draw(results))
    return Section("Baselines and ceilings", [bars, table(results), _READING])


def draw(results: Results) -> bytes:
    """F-scores as bars; a method without a number has no bar."""
    found = scores.Scores(results.table)
    bars = {}
    for category in results.groups:
        values = ((m, name, found.value(category, (m, "Pi_g-L"), "f_score_tau_x100")) for m, name in _BARS.items())
        bars[category] = [(m, name, math.nan if value is None else value) for m, name, value in values]
    return figures.score_bars(bars, "F(τ) × 100").encode()


def table(results: Results) -> Table:
    """Ceilings, retrievals, both models and the mean shape at the true camera."""
    found = scores.Scores(results.table)
    rows: list[list[Cell | str]] = []
    for category in results.groups:
        for method in ORDER:
            cells: list[Cell | str] = [category if method == ORDER[0] else "", scores.METHOD_LABELS[method]]
            for column in _COLUMNS:
                rivals = [(rival, column) for rival in _COMPETITORS if rival != method]
                for metric in cloud_scores.PRINTED:
                    best = method in _COMPETITORS and all(
                        results.better(category, (method, column), rival, metric) > 0 for rival in rivals
                    )
                    cells.append(found.cell(category, (method, column), metric, best))
            rows.append(cells)
    labels = [str(metric.label) for metric in cloud_scores.PRINTED.values()]
    heads = [(method, column) for method in ORDER for column in _COLUMNS]
    note = scores.images_note(found, results.groups, heads, "chamfer_l2_sq_x1000")
    caption = seed_notes.over_seeds(results, f"{_CAPTION} {note}".strip())
    header = ["", "", *(f"{scores.column_label(column)} {label}" for column in _COLUMNS for label in labels)]
    return Table(caption, header, rows, labels=2)

"""Baselines and ceilings: what the numbers of the models mean."""

import math

from ddf.metrics import metrics
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
_DISTANCE_METRICS = ("chamfer_l2_sq_x1000", "f_score_tau_x100")
_BARS_CAPTION = "F-scores at the true camera, L points. Blue: DDF. Orange: PC-SIREN. Grey: no model."
_BARS_ALT = "bars of the F-scores of ceiling, oracle retrieval, DDF, PC-SIREN, retrieval and mean shape, by category"
_CAPTION = (
    "At the true camera. Bold: better than all others of both models, retrieval and the mean shape, by more than two "
    "standard errors."
)
_DISTANCES = (
    "Scores of the models less those of the ceiling (truth against itself) and of retrieval; true camera, L points. "
    "Bold: better than retrieval by more than two standard errors."
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
    """Bars, the table of all rows, how far the models are from both ends."""
    bars = Figure("baselines.svg", seed_notes.of_scores(results, _BARS_CAPTION), _BARS_ALT, draw(results))
    return Section("Baselines and ceilings", [bars, table(results), _READING, distances(results)])


def draw(results: Results) -> bytes:
    """F-scores as bars; a method without a number has no bar."""
    found = scores.Scores(results.table)
    bars = {}
    for category in results.categories:
        values = ((m, name, found.value(category, (m, "Pi_g-L"), "f_score_tau_x100")) for m, name in _BARS.items())
        bars[category] = [(m, name, math.nan if value is None else value) for m, name, value in values]
    return figures.score_bars(bars, "F(τ) × 100").encode()


def table(results: Results) -> Table:
    """Ceilings, retrievals, both models and the mean shape at the true camera."""
    found = scores.Scores(results.table)
    rows: list[list[Cell | str]] = []
    for category in results.categories:
        for method in ORDER:
            cells: list[Cell | str] = [category if method == ORDER[0] else "", scores.METHOD_LABELS[method]]
            for column in _COLUMNS:
                rivals = [(rival, column) for rival in _COMPETITORS if rival != method]
                for metric in metrics.PRINTED:
                    best = method in _COMPETITORS and all(
                        results.better(category, (method, column), rival, metric) > 0 for rival in rivals
                    )
                    cells.append(found.cell(category, (method, column), metric, best))
            rows.append(cells)
    labels = [str(metric.label) for metric in metrics.PRINTED.values()]
    layout = [("", 2, False), *((scores.column_label(column), len(labels), False) for column in _COLUMNS)]
    heads = [(method, column) for method in ORDER for column in _COLUMNS]
    note = scores.images_note(found, results.categories, heads, "chamfer_l2_sq_x1000")
    caption = seed_notes.over_seeds(results, f"{_CAPTION} {note}".strip())
    return Table(caption, layout, ["", "", *labels * len(_COLUMNS)], rows, labels=2, rule_every=len(ORDER))


def distances(results: Results) -> Table:
    """Both models at the true camera, L points, as differences from the ceiling and from the retrieved shape."""
    found = scores.Scores(results.table)
    rows: list[list[Cell | str]] = []
    for category in results.categories:
        for method in (scoring.DDF, scoring.PC_SIREN):
            cells: list[Cell | str] = []
            for metric in _DISTANCE_METRICS:
                digits = metrics.PRINTED[metric].digits
                head, rival = (method, "Pi_g-L"), (baselines.RETRIEVAL, "Pi_g-L")
                own, ceiling, retrieved = (
                    found.value(category, who, metric) for who in (head, (baselines.CEILING, "Pi_g-L"), rival)
                )
                won = results.better(category, head, rival, metric) > 0
                cells.append(scores.difference(own, ceiling, digits))
                cells.append(Cell(scores.difference(own, retrieved, digits), won))
            rows.append([category if method == scoring.DDF else "", scores.METHOD_LABELS[method], *cells])
    parts = ["from the ceiling", "from retrieval"]
    groups = [(str(metrics.PRINTED[metric].label), len(parts), False) for metric in _DISTANCE_METRICS]
    header = ["", "", *parts * len(groups)]
    caption = seed_notes.of_means(results, _DISTANCES)
    return Table(caption, [("", 2, False), *groups], header, rows, labels=2, rule_every=2)

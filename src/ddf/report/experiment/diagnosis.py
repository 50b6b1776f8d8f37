"""Where the errors come from: the tables of the report on shape and camera, ceiling and retrieval, evenness of clouds.

All from the long table si3dr.csv. With several seeds a difference is that of the means over seeds.
"""

from collections.abc import Sequence

import pandas as pd

from ddf.evaluation import baselines, scoring
from ddf.report.experiment import score_tables
from ddf.report.pages import Cell, Table

_CHAMFER, _F_SCORE = "chamfer_l2_sq_x1000", "f_score_tau_x100"
_METRICS = (_CHAMFER, _F_SCORE)
_PLACED = (
    (scoring.DDF, "Pi_pred-S"),
    (scoring.DDF, "Pi_corrected-S"),
    (scoring.PC_SIREN, "Pi_pred-S"),
)
_SPREAD = (
    (scoring.TRUTH, "true cloud"),
    ((baselines.CEILING, "Pi_g-L"), "as many of its points at random"),
    ((scoring.DDF, "Pi_g-L"), score_tables.METHOD_LABELS[scoring.DDF]),
    ((scoring.DDF_ONE_CYCLE, "Pi_g-L"), score_tables.METHOD_LABELS[scoring.DDF_ONE_CYCLE]),
    ((scoring.PC_SIREN, "Pi_g-L"), score_tables.METHOD_LABELS[scoring.PC_SIREN]),
)


def split_table(table: pd.DataFrame, categories: Sequence[str], caption: str) -> Table:
    """What a score with a predicted camera is made of: the ceiling's, what the shape adds and what the camera adds.

    With S points, which is what the corrected camera is evaluated with: shape = Π_g - ceiling, camera = Π̂ - Π_g.
    """
    scores = score_tables.Scores(table, scoring.MEASURED)
    rows: list[list[Cell | str]] = []
    for category in categories:
        for method, column in _PLACED:
            cells: list[Cell | str] = []
            for metric in _METRICS:
                whole, shape, ceiling = (
                    scores.value(category, head, metric)
                    for head in ((method, column), (method, "Pi_g-S"), (baselines.CEILING, "Pi_g-S"))
                )
                digits = score_tables.METRIC_LABELS[metric][1]
                cells += [
                    _number(ceiling, digits),
                    _above(shape, ceiling, digits),
                    _above(whole, shape, digits),
                    _number(whole, digits),
                ]
            label = f"{score_tables.METHOD_LABELS[method]}, {score_tables.column_label(column)}"
            rows.append([category if not len(rows) % len(_PLACED) else "", label, *cells])
    parts = ["ceiling", "shape", "camera", "sum"]
    layout = [("", 2, False), *((score_tables.METRIC_LABELS[metric][0], len(parts), False) for metric in _METRICS)]
    return Table(caption, layout, ["", "", *parts * len(_METRICS)], rows, labels=2, rule_every=len(_PLACED))


def distance_table(table: pd.DataFrame, categories: Sequence[str], caption: str) -> Table:
    """Both models at the true camera, L points, as differences from the ceiling and from the retrieved shape.

    Bold where a model beats retrieval.
    """
    scores = score_tables.Scores(table, scoring.MEASURED)
    rows: list[list[Cell | str]] = []
    for category in categories:
        for method in (scoring.DDF, scoring.PC_SIREN):
            cells: list[Cell | str] = []
            for metric in _METRICS:
                _, digits, better = score_tables.METRIC_LABELS[metric]
                own, ceiling, retrieved = (
                    scores.value(category, (who, "Pi_g-L"), metric)
                    for who in (method, baselines.CEILING, baselines.RETRIEVAL)
                )
                won = own is not None and retrieved is not None and own != retrieved and better(own, retrieved) == own
                cells += [_above(own, ceiling, digits), Cell(_above(own, retrieved, digits), won)]
            rows.append([category if method == scoring.DDF else "", score_tables.METHOD_LABELS[method], *cells])
    parts = ["from the ceiling", "from retrieval"]
    layout = [("", 2, False), *((score_tables.METRIC_LABELS[metric][0], len(parts), False) for metric in _METRICS)]
    return Table(caption, layout, ["", "", *parts * len(_METRICS)], rows, labels=2, rule_every=2)


def _number(value: float | None, digits: int) -> str:
    return score_tables.NOTHING if value is None else f"{value:.{digits}f}"


def _above(value: float | None, other: float | None, digits: int) -> str:
    """By how much a value is above another, with its sign."""
    return score_tables.NOTHING if value is None or other is None else f"{value - other:+.{digits}f}"


def evenness_table(table: pd.DataFrame, categories: Sequence[str], caption: str) -> Table:
    """Variation of the spacing between points, per cloud and category, and its ratio to that of the true cloud."""
    scores = score_tables.Scores(table, scoring.MEASURED)
    rows = []
    for head, label in _SPREAD:
        cells = [label]
        for category in categories:
            value, truth = (scores.value(category, who, "spacing_variation") for who in (head, scoring.TRUTH))
            ratio = score_tables.NOTHING if value is None or not truth else f"{value / truth:.2f}"
            cells += [scores.text(category, head, "spacing_variation", 2), ratio]
        rows.append(cells)
    layout = [("", 1, False), *((category, 2, False) for category in categories)]
    return Table(caption, layout, ["", *["variation", "of the truth's"] * len(categories)], rows)

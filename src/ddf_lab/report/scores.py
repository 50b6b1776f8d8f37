"""Numbers of the long table si3dr.csv as the page prints them: look-up, names, tables with the better ones bold."""

import itertools
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import pandas as pd

from ddf.metrics.cloud_scores import METRICS, PRINTED
from ddf_lab.evaluation import baselines, claims, scoring
from ddf_lab.evaluation.claims import Head
from ddf_lab.report.pages import Cell, Table
from ddf_lab.report.stage_results import Results

METHOD_LABELS = {
    scoring.DDF: "DDF",
    scoring.PC_SIREN: "PC-SIREN",
    scoring.DDF_IMAGE: "DDF+image",
    scoring.DDF + scoring.THREE_VIEWS: "DDF",
    scoring.PC_SIREN + scoring.THREE_VIEWS: "PC-SIREN",
    scoring.DDF_IMAGE + scoring.THREE_VIEWS: "DDF+image",
    scoring.DDF_ONE_CYCLE: "DDF, N<sub>H</sub> = 1",
    scoring.DDF_ON_MASK: "DDF, shape moved to the mask",
    baselines.CEILING: "ceiling",
    baselines.ORACLE: "oracle retrieval",
    baselines.RETRIEVAL: "retrieval",
    baselines.MEAN_SHAPE: "mean shape",
}
CAMERA_LABELS = {"Pi_g": "Π<sub>g</sub>", "Pi_corrected": "Π̂<sub>∇</sub>", "Pi_pred": "Π̂"}
LABELS = {name: str(metric.label) for name, metric in PRINTED.items()}
NOTHING = "–"


def column_label(column: str) -> str:
    """As the paper prints it: Π<sub>g</sub>-L and so on."""
    camera, dash, size = column.partition("-")
    return CAMERA_LABELS.get(camera, camera) + dash + size


def number(value: float | None, digits: int) -> str:
    """A number as printed; a dash for none, and for a mean over nothing."""
    return NOTHING if value is None or pd.isna(value) else f"{value:.{digits}f}"


def images_note(results: Results) -> str:
    """How many images the numbers of a table are of, one sentence."""
    rows = results.per_image[(results.per_image["method"] == scoring.DDF) & (results.per_image["column"] == "Pi_g-L")]
    counts = {group: int((rows["category"] == group).sum()) for group in results.groups}
    if len(single := set(counts.values())) == 1:
        return f"{single.pop()} images of each category."
    return f"Images: {', '.join(f'{group} {count}' for group, count in counts.items())}."


class Line(NamedTuple):
    """A row of a category: its label, and what is printed: method and column, metric, digits if not the metric's."""

    label: str
    cells: Sequence[tuple[Head, str, int | None]]


def table(
    results: Results,
    categories: Collection[str],
    lines: Sequence[Line],
    header: Sequence[str],
    caption: str,
    rivals: Sequence[Head] | None = (),
    source: str = scoring.MEASURED,
    spread: bool = False,
) -> Table | None:
    """The same lines for every category that has one of their numbers.

    Args:
      rivals: a cell of one of these is bold where it is claimed to be better than that of all others, all comparisons
        of the table together; None: those of its own line. Never among quoted numbers.
      spread: the deviation over seeds stands in the rows of L points.
    Returns:
      None where the source has no number of these.
    """
    table, keys = results.table, ("category", "method", "column", "metric")
    chosen = table[(table["source"] == source) & table["value"].notna()].to_dict("records")
    found, rows = {tuple(row[key] for key in keys): row for row in chosen}, list[list[Cell | str]]()

    def among(category: str, line: Line, metric: str) -> list[Head]:
        heads = [head for head, its, _ in line.cells if its == metric] if rivals is None else rivals
        there = [head for head in heads if (category, *head, metric) in found and claims.may_claim(head, metric)]
        return there if source == scoring.MEASURED else []

    better = claims.better(
        results.trainings,
        {
            (category, *two, metric)
            for category, line in itertools.product(categories, lines)
            for metric in {metric for _, metric, _ in line.cells}
            for two in itertools.combinations(among(category, line, metric), 2)
        },
    )

    def cell(category: str, line: Line, head: Head, metric: str, digits: int | None) -> Cell:
        heads, row = among(category, line, metric), found.get((category, *head, metric))
        text, digits = NOTHING, METRICS[metric].digits if digits is None else digits
        if row:
            text = f"{float(row['value']):.{digits}f}"
            if spread and head[1].endswith("L") and row["seeds"] > 1:
                text += f" ± {float(row['spread']):.{digits}f}"
        beaten = [(category, head, other, metric) in better for other in heads if other != head]
        return Cell(text, head in heads and bool(beaten) and all(beaten))

    for category in categories:
        if any((category, *head, metric) in found for line in lines for head, metric, _ in line.cells):
            for number, line in enumerate(lines):
                cells = (cell(category, line, *each) for each in line.cells)
                rows.append(["" if number else category, line.label, *cells])
    return Table(caption, ["", *header], rows, labels=2) if rows else None


def pairs(
    results: Results,
    categories: Collection[str],
    columns: Sequence[str],
    methods: Sequence[tuple[str, str]],
    caption: str,
    source: str = scoring.MEASURED,
    labels: Mapping[str, str] = LABELS,
    spread: bool = False,
) -> Table | None:
    """Methods side by side for every metric of `labels`; a row per category and column of the paper's table.

    Args:
      methods: (name to print, method), two or more; the better ones are bold. Others: see `table`.
    """
    each = [(metric, method) for metric in labels for _, method in methods]
    lines = [
        Line(column_label(column), [((method, column), metric, None) for metric, method in each]) for column in columns
    ]
    header = ["camera, points", *(f"{label} {name}" for label in labels.values() for name, _ in methods)]
    return table(results, categories, lines, header, caption, None, source, spread)

"""Numbers of the long table si3dr.csv as the page prints them: look-up, names, pairs of methods side by side."""

from collections.abc import Collection, Mapping, Sequence

import pandas as pd

from ddf.metrics.cloud_scores import METRICS, PRINTED
from ddf_lab.evaluation import baselines, scoring
from ddf_lab.report.pages import Cell, Table
from ddf_lab.report.stage_results import Head, Results

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


class Scores:
    """Look-up of the long table by category, method, column and metric, per source."""

    def __init__(self, table: pd.DataFrame, source: str = scoring.MEASURED) -> None:
        chosen = table[(table["source"] == source) & table["value"].notna()]
        keys = ["category", "method", "column", "metric"]
        self.rows = {tuple(row[key] for key in keys): row for row in chosen.to_dict("records")}

    def value(self, category: str, head: Head, metric: str) -> float | None:
        """The number, or None where the source has none."""
        row = self.rows.get((category, *head, metric))
        return None if row is None else float(row["value"])

    def images(self, category: str, heads: Sequence[Head], metric: str) -> list[int]:
        """Image counts of the cells that exist."""
        found = [self.rows.get((category, *head, metric)) for head in heads]
        return [int(row["images"]) for row in found if row is not None]

    def text(self, category: str, head: Head, metric: str, digits: int | None = None, spread: bool = False) -> str:
        """The number as printed, with `spread` as `mean ± standard deviation` where it is a mean over seeds; a dash
        where there is none.
        """
        row = self.rows.get((category, *head, metric))
        if row is None:
            return NOTHING
        digits = METRICS[metric].digits if digits is None else digits
        value = f"{float(row['value']):.{digits}f}"
        return f"{value} ± {float(row['spread']):.{digits}f}" if spread and row["seeds"] > 1 else value


def images_note(scores: Scores, categories: Collection[str], heads: Sequence[Head], metric: str) -> str:
    """How many images the numbers of a table are of, one sentence; empty where the table says it cell by cell."""
    counts = {category: sorted(set(scores.images(category, heads, metric))) for category in categories}
    counts = {category: found for category, found in counts.items() if found}
    if not counts or any(len(found) > 1 for found in counts.values()):
        return ""
    single = {found[0] for found in counts.values()}
    if len(single) == 1:
        return f"{single.pop()} images of each category."
    return f"Images: {', '.join(f'{category} {found[0]}' for category, found in counts.items())}."


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

    Bold: better than all others of the row, where their paired differences are seen (`paired.Difference`); never among
    quoted numbers.
    Cells of a category whose numbers are of different numbers of images say of how many.

    Args:
      methods: (name to print, method), two or more. spread: the deviation over seeds stands in the rows of L points.
    Returns:
      None where the source has no number of these methods.
    """
    scores = Scores(results.table, source)
    measured = source == scoring.MEASURED
    heads = [(method, column) for column in columns for _, method in methods]
    rows: list[list[Cell | str]] = []
    for category in categories:
        if not any((category, *head, metric) in scores.rows for head in heads for metric in labels):
            continue
        counted = measured and len(set(scores.images(category, heads, next(iter(labels))))) > 1
        for column in columns:
            cells: list[Cell | str] = [category if column == columns[0] else "", column_label(column)]
            row = [(method, column) for _, method in methods]
            for metric in labels:
                for head in row:
                    rivals = [other for other in row if other != head and (category, *other, metric) in scores.rows]
                    best = measured and all(results.better(category, head, other, metric) > 0 for other in rivals)
                    count = f" ({n[0]})" if counted and (n := scores.images(category, [head], metric)) else ""
                    text = scores.text(category, head, metric, spread=spread and column.endswith("L"))
                    cells.append(Cell(text + count, best and bool(rivals)))
            rows.append(cells)
    if not rows:
        return None
    header = ["", "camera, points", *(f"{label} {name}" for label in labels.values() for name, _ in methods)]
    return Table(caption, header, rows, labels=2)

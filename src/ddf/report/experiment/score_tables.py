"""The tables of the report, from the long table si3dr.csv: one source for every number that is printed."""

from collections.abc import Sequence

import pandas as pd

from ddf.evaluation import baselines, paper_results, scoring
from ddf.report.pages import Cell, Table

METRIC_LABELS = {
    "chamfer_l2_sq_x1000": ("D<sub>C</sub> ↓", 3, min),
    "f_score_tau_x100": ("F<sub>τ</sub> ↑", 2, max),
    "f_score_2tau_x100": ("F<sub>2τ</sub> ↑", 2, max),
}
METHOD_LABELS = {
    scoring.DDF: "DDF",
    scoring.PC_SIREN: "PC-SIREN",
    scoring.DDF_ONE_CYCLE: "DDF, N<sub>H</sub> = 1",
    "p2m": "P2M",
    "3dr": "3DR",
    baselines.CEILING: "ceiling: truth against itself",
    baselines.CEILING_VISIBLE: "ceiling, visible points of the truth only",
    baselines.VISIBLE_AGAINST_ALL: "ceiling, visible points against all",
    baselines.ORACLE: "oracle retrieval (best training shape)",
    baselines.RETRIEVAL: "retrieval (nearest training image)",
    baselines.MEAN_SHAPE: "mean shape",
}
CAMERA_LABELS = {"Pi_g": "Π<sub>g</sub>", "Pi_corrected": "Π̂<sub>∇</sub>", "Pi_pred": "Π̂"}
BASELINE_ORDER = (
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
NOTHING = "–"

Head = tuple[str, str]  # method, column


def column_label(column: str) -> str:
    """As the paper prints it: Π<sub>g</sub>-L and so on."""
    camera, dash, size = column.partition("-")
    return CAMERA_LABELS.get(camera, camera) + dash + size


class Scores:
    """Look-up of the long table by category, method, column and metric, per source."""

    def __init__(self, table: pd.DataFrame, source: str) -> None:
        chosen = table[table["source"] == source]
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

    def text(self, category: str, head: Head, metric: str, digits: int) -> str:
        """The number as printed, `mean ± standard deviation` for a mean over seeds; a dash where there is none."""
        row = self.rows.get((category, *head, metric))
        if row is None:
            return NOTHING
        value = f"{float(row['value']):.{digits}f}"
        return f"{value} ± {float(row['spread']):.{digits}f}" if row["seeds"] > 1 else value

    def cell(self, category: str, head: Head, metric: str, best: bool = False, count: bool = False) -> Cell:
        """A printed number with what its spread is and its image count as a note; `count` prints the count too."""
        row = self.rows.get((category, *head, metric))
        if row is None:
            return Cell(NOTHING)
        text = self.text(category, head, metric, METRIC_LABELS[metric][1])
        if pd.isna(row["images"]):
            return Cell(text, best)
        over = f"standard deviation over {row['seeds']:.0f} seeds" if row["seeds"] > 1 else "standard error over images"
        error = "" if pd.isna(row["spread"]) else f"{over} {float(row['spread']):.3g}, "
        return Cell(f"{text} ({int(row['images'])})" if count else text, best, f"{error}{int(row['images'])} images")


def comparison(
    table: pd.DataFrame, categories: Sequence[str], groups: Sequence[tuple[str, str, Sequence[Head]]], caption: str
) -> Table:
    """The layout of the paper: three rows per category, one column per method and camera, our columns first.

    Bold is the better of the methods that have the same column, among our own numbers.

    Args:
      groups: (name, source, heads); a group without numbers in any category is left out.
    """
    scores = {source: Scores(table, source) for _, source, _ in groups}
    kept = [group for group in groups if _has_numbers(scores[group[1]], categories, group[2])]
    own = [head for _, source, heads in kept if source == scoring.MEASURED for head in heads]
    rows = []
    for category in categories:
        for metric, (label, _, _) in METRIC_LABELS.items():
            counts = set(scores[scoring.MEASURED].images(category, own, metric))
            cells: list[Cell | str] = [category if label.startswith("D") else "", label]
            cells.append(str(counts.copy().pop()) if len(counts) == 1 else NOTHING)
            for _, source, heads in kept:
                for head in heads:
                    measured = source == scoring.MEASURED
                    best = measured and _is_best(scores[source], category, head, metric, own)
                    cells.append(scores[source].cell(category, head, metric, best, measured and len(counts) > 1))
            rows.append(cells)
    header = ["", "", "images", *(_short(head) for _, _, heads in kept for head in heads)]
    layout = [("", 3, False), *((name, len(heads), source != scoring.MEASURED) for name, source, heads in kept)]
    return Table(caption, layout, header, rows, labels=2, rule_every=len(METRIC_LABELS))


def _short(head: Head) -> str:
    return METHOD_LABELS[head[0]] if head[1] == "view frame" else column_label(head[1])


def _has_numbers(scores: Scores, categories: Sequence[str], heads: Sequence[Head]) -> bool:
    return any(
        (category, *head, metric) in scores.rows
        for category in categories
        for head in heads
        for metric in METRIC_LABELS
    )


def _is_best(scores: Scores, category: str, head: Head, metric: str, rivals: Sequence[Head]) -> bool:
    values = {rival: scores.value(category, rival, metric) for rival in rivals if rival[1] == head[1]}
    present = {rival: value for rival, value in values.items() if value is not None}
    better = METRIC_LABELS[metric][2]
    return len(present) > 1 and present.get(head) == better(present.values())


def paper_table(table: pd.DataFrame, categories: Sequence[str], caption: str) -> Table:
    """Table `si3dr` of the paper: our columns, then the paper's."""
    heads = paper_results.SI3DR_COLUMNS
    groups = [
        (f"{METHOD_LABELS[method]}, {source}", key, [head for head in heads if head[0] == method])
        for key, source in ((scoring.MEASURED, "measured here"), (paper_results.SOURCE, paper_results.SOURCE))
        for method in (scoring.DDF, scoring.PC_SIREN)
    ]
    others = [head for head in heads if head[0] in ("p2m", "3dr")]
    return comparison(table, categories, [*groups, (paper_results.SOURCE, paper_results.SOURCE, others)], caption)


def one_cycle_table(table: pd.DataFrame, categories: Sequence[str], caption: str) -> Table:
    """Table `si3dr1h` of the paper (N_H = 1): our columns, the same columns with all cycles, then the paper's."""
    heads = paper_results.SI3DR1H_COLUMNS
    all_cycles = [(scoring.DDF, column) for _, column in heads]
    groups = [
        ("DDF, N<sub>H</sub> = 1, measured here", scoring.MEASURED, heads),
        ("DDF, all cycles, measured here", scoring.MEASURED, all_cycles),
        (f"DDF, N<sub>H</sub> = 1, {paper_results.SOURCE}", paper_results.SOURCE, heads),
    ]
    return comparison(table, categories, groups, caption)


def baseline_table(table: pd.DataFrame, categories: Sequence[str], caption: str) -> Table:
    """Ceilings, retrievals, both models and the mean shape at the true camera."""
    scores = Scores(table, scoring.MEASURED)
    columns = ("Pi_g-L", "Pi_g-S")
    rows: list[list[Cell | str]] = []
    for category in categories:
        for method in BASELINE_ORDER:
            heads = [(method, column) for column in columns]
            counts = scores.images(category, heads, "chamfer_l2_sq_x1000")
            cells: list[Cell | str] = [category if method == BASELINE_ORDER[0] else "", METHOD_LABELS[method]]
            cells.append(str(counts[0]) if counts else NOTHING)
            for head in heads:
                rivals = [(rival, head[1]) for rival in _COMPETITORS]
                for metric in METRIC_LABELS:
                    best = method in _COMPETITORS and _is_best(scores, category, head, metric, rivals)
                    cells.append(scores.cell(category, head, metric, best))
            rows.append(cells)
    header = ["", "", "images", *[label for label, _, _ in METRIC_LABELS.values()] * len(columns)]
    layout = [("", 3, False), *((column_label(column), len(METRIC_LABELS), False) for column in columns)]
    return Table(caption, layout, header, rows, labels=2, rule_every=len(BASELINE_ORDER))


def camera_table(table: pd.DataFrame, categories: Sequence[str], caption: str) -> Table:
    """Median errors of predicted and corrected cameras and of the estimated scale; how many cameras are far off."""
    scores = Scores(table, scoring.MEASURED)
    heads = [(scoring.DDF, "Pi_pred"), (scoring.DDF, "Pi_corrected"), (scoring.PC_SIREN, "Pi_pred")]
    metrics = {
        "azimuth_error_deg_median": 1,
        "azimuth_far_x100": 0,
        "elevation_error_deg_median": 2,
        "radius_error_median": 3,
        "scale_error_percent_median": 1,
    }
    rows: list[list[Cell | str]] = []
    for category in categories:
        for head in heads:
            texts = [scores.text(category, head, metric, digits) for metric, digits in metrics.items()]
            label = f"{METHOD_LABELS[head[0]]}, {CAMERA_LABELS[head[1]]}"
            counts = scores.images(category, [head], next(iter(metrics)))
            rows.append([category if head == heads[0] else "", label, str(counts[0]) if counts else NOTHING, *texts])
    far = f"azimuth > {scoring.FAR_AZIMUTH_DEG:.0f}°, % of images"
    header = ["", "", "images", "azimuth, degrees", far, "elevation, degrees", "radius, benchmark units", "scale, %"]
    return Table(caption, [("", len(header), False)], header, rows, labels=2, rule_every=len(heads))

"""The tables of README.md and docs/results.md say what the committed reports measured.

`python tests/docs/test_results_page.py` writes what the files si3dr.csv in reports/ say into them.
"""

import csv
import itertools
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CATEGORIES = ("chair", "plane", "car")
CHAMFER, F_TAU, F_2TAU = "chamfer_l2_sq_x1000", "f_score_tau_x100", "f_score_2tau_x100"
METRICS = {"D_C": (CHAMFER, 3), "F(τ)": (F_TAU, 2), "F(2τ)": (F_2TAU, 2)}
METHODS = {  # method, and the column of the predicted camera
    "DDF": ("ddf", "Pi_pred"),
    "PC-SIREN": ("pc_siren", "Pi_pred"),
    "DDF, camera corrected by the mask": ("ddf", "Pi_corrected"),
}
PAIRS = {  # rows with D_C and F(τ) in one cell
    "DDF, true camera": ("ddf", "Pi_g-L"),
    "DDF, true camera, one projection cycle instead of three": ("ddf_nh1", "Pi_g-L"),
    "PC-SIREN, true camera": ("pc_siren", "Pi_g-L"),
    "DDF, predicted camera": ("ddf", "Pi_pred-L"),
    "PC-SIREN, predicted camera": ("pc_siren", "Pi_pred-L"),
    "mean training shape": ("mean_shape", "Pi_g-L"),
    "retrieval of the nearest training image": ("retrieval", "Pi_g-L"),
    "ceiling: the truth against itself": ("ceiling", "Pi_g-L"),
    "oracle: the best training shape": ("oracle_retrieval", "Pi_g-L"),
    "the mean training shape": ("mean_shape", "Pi_g-L"),
    "one cycle": ("ddf_nh1", "Pi_g-L"),
    "three cycles": ("ddf", "Pi_g-L"),
}
CAMERAS = {  # median errors
    "azimuth, degrees": ("Pi_pred", "azimuth_error_deg_median", 1),
    "azimuth after the correction by the mask": ("Pi_corrected", "azimuth_error_deg_median", 1),
    "elevation, degrees": ("Pi_pred", "elevation_error_deg_median", 2),
}
Rows = list[list[str]]


class Measured:
    """The measured rows of a report's si3dr.csv."""

    def __init__(self, report: str) -> None:
        path = ROOT / "reports" / report / "si3dr.csv"
        with path.open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["source"] == "measured"]
        self.rows: dict[tuple[str, ...], dict[str, str]] = {
            (row["category"], row["method"], row["column"], row["metric"]): row for row in rows
        }

        self.claims = claims(path.with_name("README.md").read_text())

    def value(self, *key: str) -> float:
        return float(self.rows[key]["value"])

    def text(self, *key: str, digits: int, spread: bool = True) -> str:
        """The mean, ± the deviation over seeds where there are several."""
        row, value = self.rows[key], f"{self.value(*key):.{digits}f}"
        return f"{value} ± {float(row['spread']):.{digits}f}" if spread and float(row["seeds"]) > 1 else value


def claims(report: str) -> set[tuple[str, ...]]:
    """Category, method, column and metric of the cells that the report's first table sets in bold."""
    table = next(block for block in report.split("\n\n") if block.startswith("|"))
    found, category = set(), ""
    for line in table.splitlines()[2:]:
        first, label, *values = [cell.strip() for cell in line.strip("|").split(" | ")]
        category = first or category
        camera, _, size = label.partition("-")
        column = {"Π<sub>g</sub>": "Pi_g", "Π̂<sub>∇</sub>": "Pi_corrected", "Π̂": "Pi_pred"}[camera] + f"-{size}"
        keys = [(metric, method) for metric in (CHAMFER, F_TAU, F_2TAU) for method in ("ddf", "pc_siren")]
        found |= {
            (category, method, column, metric)
            for (metric, method), value in zip(keys, values, strict=True)
            if value.startswith("**")
        }
    return found


def plain_pairs(measured: Measured, rows: Rows) -> Rows:
    """D_C and F(τ) without spreads, as README prints them."""
    return [[name, *_pair(measured, name, 1, False)] for name, *_ in rows]


def pairs(measured: Measured, rows: Rows) -> Rows:
    """D_C and F(τ) with spreads."""
    return [[name, *_pair(measured, name, 2, True)] for name, *_ in rows]


def _pair(measured: Measured, name: str, digits: int, spread: bool) -> list[str]:
    keys = [(category, *PAIRS[name]) for category in CATEGORIES]
    chamfers = [measured.text(*key, CHAMFER, digits=3, spread=spread) for key in keys]
    scores = [measured.text(*key, F_TAU, digits=digits, spread=spread) for key in keys]
    return [", ".join(pair) for pair in zip(chamfers, scores, strict=True)]


def true_camera(measured: Measured, rows: Rows) -> Rows:
    """Both models by points and metric; bold: where the report claims a difference."""
    return _by_metric(measured, rows, lambda name: "Pi_g")


def predicted_camera(measured: Measured, rows: Rows) -> Rows:
    """As `true_camera`, at the predicted camera and after its correction."""
    return _by_metric(measured, rows, lambda name: METHODS[name][1])


def _by_metric(measured: Measured, rows: Rows, camera: Callable[[str], str]) -> Rows:
    filled = []
    for (points, label), group in itertools.groupby(rows, key=lambda row: row[:2]):
        metric, digits = METRICS[label]
        names = [row[2] for row in group]
        cells = {name: [points, label, name] for name in names}
        for category in CATEGORIES:
            keys = {name: (category, METHODS[name][0], f"{camera(name)}-{points}", metric) for name in names}
            for name, key in keys.items():
                text = measured.text(*key, digits=digits)
                cells[name].append(f"**{text}**" if key in measured.claims else text)
        filled += cells.values()
    return filled


def cameras(measured: Measured, rows: Rows) -> Rows:
    """Median errors of the DDF's cameras."""
    return [
        [name, *(measured.text(c, "ddf", *CAMERAS[name][:2], digits=CAMERAS[name][2]) for c in CATEGORIES)]
        for name, *_ in rows
    ]


TABLES = [  # page, the line above the table, what fills it, the report
    ("README.md", "## Results", plain_pairs, "cpu"),
    ("docs/results.md", "### True camera", true_camera, "cpu"),
    ("docs/results.md", "### Predicted camera", predicted_camera, "cpu"),
    ("docs/results.md", "Median errors of the predicted camera:", cameras, "cpu"),
    ("docs/results.md", "### Baselines and ceilings, true camera, L", pairs, "cpu"),
    ("docs/results.md", "### One projection cycle instead of three, true camera, L", pairs, "cpu"),
    ("docs/results.md", "At the true camera, the paper's way:", true_camera, "cpu_paper"),
    ("docs/results.md", "At the predicted camera, the paper's way:", predicted_camera, "cpu_paper"),
    ("docs/results.md", "After one cycle and after three, the paper's way, true camera, L:", pairs, "cpu_paper"),
]


def _parts(text: str, above: str) -> tuple[str, str, str]:
    """A page before, in and after the rows of the first table below a line."""
    found = re.search(rf"(?ms)^{re.escape(above)}$.*?^\|[ :|-]+\|\n", text)
    assert found, above
    end = re.compile(r"(?m)^(?!\|)").search(text, found.end())
    return text[: found.end()], text[found.end() : end.start() if end else None], text[end.start() if end else None :]


def cells(lines: str) -> Rows:
    return [line.strip("| ").split(" | ") for line in lines.splitlines()]


def lines_of(rows: Sequence[Sequence[str]]) -> str:
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


@pytest.mark.parametrize("page, above, fill, report", TABLES, ids=[above for _, above, _, _ in TABLES])
def test_tables_are_of_the_committed_report(page, above, fill, report):
    _, table, _ = _parts((ROOT / page).read_text(), above)
    assert cells(table) == fill(Measured(report), cells(table))


def test_readme_has_the_eight_rows():
    assert len(cells(_parts((ROOT / "README.md").read_text(), "## Results")[1])) == 8


if __name__ == "__main__":
    for page, above, fill, report in TABLES:
        before, table, after = _parts((ROOT / page).read_text(), above)
        (ROOT / page).write_text(before + lines_of(fill(Measured(report), cells(table))) + after)

"""The tables of README.md and docs/results.md say what the committed reports measured.

`python tests/docs/test_results_page.py` writes what the files si3dr.csv in reports/ say into them.
"""

import csv
import itertools
import json
import re
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CATEGORIES = ("chair", "plane", "car")
CHAMFER, F_TAU, F_2TAU = "chamfer_l2_sq_x1000", "f_score_tau_x100", "f_score_2tau_x100"
METRICS = {
    "D_C": (CHAMFER, 3),
    "F(τ)": (F_TAU, 2),
    "F(2τ)": (F_2TAU, 2),
    "precision": ("precision_tau_x100", 1),
    "recall": ("recall_tau_x100", 1),
}
LABELS = {"D<sub>C</sub> ↓": "D_C", "F<sub>τ</sub> ↑": "F(τ)", "F<sub>2τ</sub> ↑": "F(2τ)"}  # of reports
MODELS = {"DDF": "ddf", "PC-SIREN": "pc_siren", "DDF+image": "ddf_image"}
PAIRS = {  # rows with D_C and F(τ) in one cell
    "DDF, true camera": ("ddf", "Pi_g-L"),
    "DDF, true camera, one projection cycle instead of three": ("ddf_nh1", "Pi_g-L"),
    "PC-SIREN, true camera": ("pc_siren", "Pi_g-L"),
    "DDF, predicted camera": ("ddf", "Pi_pred-L"),
    "PC-SIREN, predicted camera": ("pc_siren", "Pi_pred-L"),
    "DDF+image, true camera": ("ddf_image", "Pi_g-L"),
    "DDF+image, predicted camera": ("ddf_image", "Pi_pred-L"),
    "DDF+image, three images, true cameras": ("ddf_image_3views", "Pi_g-L"),
    "mean training shape": ("mean_shape", "Pi_g-L"),
    "retrieval of the nearest training image": ("retrieval", "Pi_g-L"),
    "ceiling: the truth against itself": ("ceiling", "Pi_g-L"),
    "oracle: the best training shape": ("oracle_retrieval", "Pi_g-L"),
    "the mean training shape": ("mean_shape", "Pi_g-L"),
}
CAMERAS = {  # median errors
    "azimuth, degrees": ("Pi_pred", "azimuth_error_deg_median", 1),
    "turned round, % of images": ("Pi_pred", "azimuth_turned_x100", 0),
    "IoU of the silhouette": ("Pi_pred", "silhouette_iou", 2),
    "azimuth after the correction by the mask": ("Pi_corrected", "azimuth_error_deg_median", 1),
    "elevation, degrees": ("Pi_pred", "elevation_error_deg_median", 2),
}
Rows = list[list[str]]


class Measured:
    """The measured rows of a report's si3dr.csv; of a group alone where `report` is such as `real:procedural`."""

    def __init__(self, report: str) -> None:
        report, _, group = report.partition(":")
        path = ROOT / "reports" / report / "si3dr.csv"
        self.group, self.page = group, path.with_name("README.md").read_text()
        with path.open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["source"] == "measured"]
        self.rows: dict[tuple[str, ...], dict[str, str]] = {
            (row["category"].removeprefix(f"{group} "), row["method"], row["column"], row["metric"]): row
            for row in rows
        }
        self.claims = {(category.removeprefix(f"{group} "), *rest) for category, *rest in claims(self.page)}

    def value(self, *key: str) -> float:
        return float(self.rows[key]["value"])

    def text(self, *key: str, digits: int, spread: bool = True) -> str:
        """The mean, ± the deviation over seeds where there are several."""
        row, value = self.rows[key], f"{self.value(*key):.{digits}f}"
        return f"{value} ± {float(row['spread']):.{digits}f}" if spread and float(row["seeds"]) > 1 else value


def claims(report: str) -> set[tuple[str, ...]]:
    """Category, method, column and metric of the cells of both models that the report's tables set in bold."""
    found, category = set(), ""
    for table in (block for block in report.split("\n\n") if block.startswith("|  | camera, points |")):
        header, _, *lines = (
            [cell.strip() for cell in line.strip("|").split(" | ")] for line in table.strip().splitlines()
        )
        keys = [name.rpartition(" ") for name in header[2:]]
        for first, label, *values in lines:
            category = first or category
            camera, _, size = label.partition("-")
            column = {"Π<sub>g</sub>": "Pi_g", "Π̂<sub>∇</sub>": "Pi_corrected", "Π̂": "Pi_pred"}[camera] + f"-{size}"
            found |= {
                (category, MODELS[method], column, METRICS[LABELS.get(metric, metric.removesuffix(" ↑"))][0])
                for (metric, _, method), value in zip(keys, values, strict=True)
                if value.startswith("**") and method in MODELS
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
    """Both models by metric; bold: where the report claims a difference."""
    return _by_metric(measured, rows, "Pi_g")


def predicted_camera(measured: Measured, rows: Rows) -> Rows:
    """As `true_camera`, at the predicted camera."""
    return _by_metric(measured, rows, "Pi_pred")


def _by_metric(measured: Measured, rows: Rows, camera: str) -> Rows:
    filled = []
    for label, group in itertools.groupby(rows, key=lambda row: row[0]):
        metric, digits = METRICS[label]
        names = [row[1] for row in group]
        cells = {name: [label, name] for name in names}
        for category in CATEGORIES:
            keys = {name: (category, MODELS[name], f"{camera}-L", metric) for name in names}
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


def far(measured: Measured, rows: Rows) -> Rows:
    """Of the report's test shapes beside their nearest training shapes, those of the DDF."""
    lines = {line[0]: line for line in cells(_parts(measured.page, "## Far from the training shapes")[1])}
    _, shapes, ranks, above, *_ = zip(*(lines[f"{measured.group} {c}"] for c in CATEGORIES), strict=True)
    counts = [f"{some} of {every}" for some, every in zip(above, shapes, strict=True)]
    return [[name, *values] for (name, *_), values in zip(rows, (ranks, counts), strict=True)]


TABLES = [  # page, the line above the table, what fills it, the report, and the group of its shapes where it has two
    ("README.md", "On real shapes:", plain_pairs, "real:real"),
    ("docs/results.md", "Real shapes, true camera:", true_camera, "real:real"),
    ("docs/results.md", "Real shapes, predicted camera:", predicted_camera, "real:real"),
    ("docs/results.md", "Real shapes, cameras and silhouettes of the DDF:", cameras, "real:real"),
    ("docs/results.md", "Real shapes, baselines and ceiling, true camera:", pairs, "real:real"),
    ("docs/results.md", "The same models on procedural test shapes, true camera:", true_camera, "real:procedural"),
    ("docs/results.md", "### Where they fail", far, "real:real"),
    ("README.md", "On procedural shapes:", plain_pairs, "cpu"),
    ("docs/results.md", "### True camera", true_camera, "cpu"),
    ("docs/results.md", "### Predicted camera", predicted_camera, "cpu"),
    ("docs/results.md", "Median errors of the predicted camera:", cameras, "cpu"),
    ("docs/results.md", "### Baselines and ceilings, true camera", pairs, "cpu"),
    ("docs/results.md", "At the true camera, the paper's way:", true_camera, "cpu_paper"),
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


@pytest.mark.parametrize(("above", "count"), [("On real shapes:", 10), ("On procedural shapes:", 8)])
def test_readme_has_all_rows(above, count):
    assert len(cells(_parts((ROOT / "README.md").read_text(), above)[1])) == count


def test_generated_shapes_are_scored_as_measured():
    rows = json.loads((ROOT / "reports" / "bench" / "generate.json").read_text())["rows"]
    errors = {row["what"]: row["error"] for row in rows}
    fakes = ("noisy samples", "blurred samples", "mean shape")

    def line(key: str, *names: str) -> list[str]:
        return ["; ".join(f"{errors[f'{each}: {name}'][key]:.1f}" for name in names) for each in CATEGORIES]

    expected = [line("one_nna_percent", "samples"), line("one_nna_percent", "other true shapes")]
    expected += [line("energy_x1000", "samples"), line("energy_x1000", *fakes)]
    _, table, _ = _parts((ROOT / "docs" / "generative.md").read_text(), "![Eight new chairs](generated_chairs.webp)")
    assert [row[1:] for row in cells(table)] == expected
    for each in CATEGORIES:  # a score that is fooled by noise, blur or one shape says nothing
        score = {name: errors[f"{each}: {name}"]["energy_x1000"] for name in ("samples", *fakes)}
        assert min(score, key=score.__getitem__) == "samples"


if __name__ == "__main__":
    for page, above, fill, report in TABLES:
        before, table, after = _parts((ROOT / page).read_text(), above)
        (ROOT / page).write_text(before + lines_of(fill(Measured(report), cells(table))) + after)

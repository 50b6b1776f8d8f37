"""Writes what the files in reports/ say into README.md and docs/*.md: numbers of tables, bold, claims.

Every number in a table of results is one of a committed CSV or JSON file, which `TABLES` names.
"""

import csv
import itertools
import json
import re
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from docs import recomputed

ROOT = Path(__file__).resolve().parents[1]
CATEGORIES = ("chair", "plane", "car")
CHAMFER, F_TAU, F_2TAU = "chamfer_l2_sq_x1000", "f_score_tau_x100", "f_score_2tau_x100"
METRICS = {
    "D_C": (CHAMFER, 3),
    "F(τ)": (F_TAU, 2),
    "F(2τ)": (F_2TAU, 2),
    "precision": ("precision_tau_x100", 1),
    "recall": ("recall_tau_x100", 1),
}
PRINTED = {"D_C": "D<sub>C</sub> ↓", "F(τ)": "F<sub>τ</sub> ↑"}
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
    "one cloud for all images": ("mean_shape", "Pi_g-L"),
    "retrieval of the nearest training image": ("retrieval", "Pi_g-L"),
    "ceiling: the truth against itself": ("ceiling", "Pi_g-L"),
    "oracle: the best training shape": ("oracle_retrieval", "Pi_g-L"),
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
        self.folder = path.parent
        self.group, self.page = group, path.with_name("README.md").read_text()
        with path.open(newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["source"] == "measured"]
        self.rows: dict[tuple[str, ...], dict[str, str]] = {
            (row["category"].removeprefix(f"{group} "), row["method"], row["column"], row["metric"]): row
            for row in rows
        }
        self.open = path.with_name("per_image.csv").is_file()  # or no claim can be recomputed
        printed = next(recomputed.tables(self.page)) if self.open else {}
        self.claims = {
            (category.removeprefix(f"{group} "), method, column, METRICS[LABELS[metric]][0])
            for (category, method, column, metric), value in printed.items()
            if value.startswith("**")
        }

    def value(self, *key: str) -> float:
        """Of a category, method, column and metric."""
        return float(self.rows[key]["value"])

    def text(self, *key: str, digits: int, spread: bool = True) -> str:
        """The mean, ± the deviation over seeds where there are several."""
        row, value = self.rows[key], f"{self.value(*key):.{digits}f}"
        return f"{value} ± {float(row['spread']):.{digits}f}" if spread and float(row["seeds"]) > 1 else value


def pairs(measured: Measured, rows: Rows, digits: int = 2, spread: bool = True) -> Rows:
    """D_C and F(τ) in one cell."""
    return [[name, *_pair(measured, name, digits, spread)] for name, *_ in rows]


def _pair(measured: Measured, name: str, digits: int, spread: bool) -> list[str]:
    keys = [(category, *PAIRS[name]) for category in CATEGORIES]
    chamfers = [measured.text(*key, CHAMFER, digits=3, spread=spread) for key in keys]
    scores = [measured.text(*key, F_TAU, digits=digits, spread=spread) for key in keys]
    return [", ".join(pair) for pair in zip(chamfers, scores, strict=True)]


def at_camera(measured: Measured, rows: Rows, camera: str = "Pi_g") -> Rows:
    """All models by metric; bold: where the report claims a difference."""
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
    lines = {line[0]: line for line in cells(parts(measured.page, "## Far from the training shapes")[1])}
    _, shapes, ranks, above, *_ = zip(*(lines[f"{measured.group} {c}"] for c in CATEGORIES), strict=True)
    counts = [f"{some} of {every}" for some, every in zip(above, shapes, strict=True)]
    return [[name, *values] for (name, *_), values in zip(rows, (ranks, counts), strict=True)]


def best(measured: Measured) -> str:
    """Which model has the best means of D_C and F(τ) at both cameras, and which of them are claimed to be better."""
    found, claimed = Counter[str](), dict[str, list[str]]()
    scores = recomputed.Scores(measured.folder) if measured.claims else None
    for camera, category, metric in itertools.product(("true", "predicted"), CATEGORIES, ("D_C", "F(τ)")):
        column, name = {"true": "Pi_g-L", "predicted": "Pi_pred-L"}[camera], METRICS[metric][0]
        keys = {model: (category, own, column, name) for model, own in MODELS.items()}
        there = {model: measured.value(*key) for model, key in keys.items() if key in measured.rows}
        found[(min if metric == "D_C" else max)(there, key=lambda model: there[model])] += 1
        for model, key in keys.items():
            if scores and key in measured.claims:
                cell = (f"{measured.group} {category}".strip(), key[1], column, PRINTED[metric])
                claimed.setdefault(f"{model}, {camera} camera", []).append(f"{category} {metric} ({scores.told(cell)})")
    means = f"Best of {found.total()} means: {', '.join(f'{name} {count}' for name, count in found.most_common())}."
    if not measured.open:
        return f"{means} None is claimed to be better: scores per image of this run were not kept."
    said = "; ".join(f"{who}: {', '.join(cells)}" for who, cells in claimed.items()) or "none"
    return f"{means} Claimed to be better than both other models: {said}."


def bench(name: str) -> list[dict]:
    """The rows of a benchmark's file."""
    return json.loads((ROOT / "reports" / "bench" / f"{name}.json").read_text())["rows"]


def frontier(rows: Rows) -> Rows:
    """Of two shapes: time of an image, median error of depth, and wrong rays of those from inside."""
    kinds = {"network": "sine, 500 steps", "patches": "patches, 0.0003"}
    kinds |= {f"{side}³": f"distances, {side}" for side in (128, 256)}
    found, filled = {(row["what"], row["size"]["shape"]): row for row in bench("frontier")}, []
    for name, *_ in rows:
        kind = next((own for word, own in kinds.items() if word in name), "mesh")
        cells = [name]
        for shape in ("rock 10,000", "hoops"):
            row = found[kind, shape]
            error = row["error"]
            cells += [
                f"{1000 * row['median_s']:.0f} ms",
                f"{error['depth_median']:.5f}",
                f"{error['wrong_inner']:.1f} %",
            ]
        filled.append(cells)
    return filled


def one_shape(rows: Rows) -> Rows:
    """Errors of depth by sample type, of the fit and of the paper's."""
    with (ROOT / "reports" / "fit" / "fit.csv").open(newline="") as file:
        found = {
            (row["source"], row["type"]): float(row["value"])
            for row in csv.DictReader(file)
            if row["metric"] == "depth_l1_x10"
        }
    return [
        [name, *(f"{found['measured' if name.endswith('here') else 'paper, bunny', kind]:.2f}" for kind in "UABOTS")]
        for name, *_ in rows
    ]


def completed(rows: Rows) -> Rows:
    """D_C, F(τ), and the gain in F(τ) over the image, of rows measured with it."""
    kinds = {
        "from the image": "image",
        "mean": "mean",
        "nearest": "nearest",
        "weaker": "sdf, 4000 steps, prior 0.01",
        "signed": "sdf",
    }
    found, filled = {row["what"]: row for row in bench("complete")}, []
    for name, *_ in rows:
        kind, cells = next((own for word, own in kinds.items() if word in name), "depth"), [name]
        for category in ("chair", "plane"):
            row = found[f"{category}, test: {kind}"]
            error = row["error"]
            cells.append(f"{error['chamfer_l2_sq_x1000']:.3f}, {error['f_score_tau_x100']:.1f}")
            if "f_gain" in error and "each" in row:
                cells[-1] += f", {error['f_gain']:.1f} ± {error['f_gain_error']:.1f}"
        filled.append(cells)
    return filled


def told_apart(rows: Rows) -> Rows:
    """Whom `ddf complete` warns of."""
    found, filled = {row["what"]: row for row in bench("complete")}, []
    for name, *_ in rows:
        cells = [name]
        for kind in ("chair", "plane"):
            row = found[f"{kind}, test: told apart"]
            size, error = row["size"], row["error"]
            many = size["others" if name.startswith("other") else "shapes"]
            share = error["wrong_warned" if name.startswith("other") else "right_warned"]
            if "lean" in name:
                cells.append(f"{error['leans_deg']:.1f}")
            else:
                count = error["upside_down"] if "upside" in name else share * many / 100
                cells.append(f"{count:.0f} of {many}")
        filled.append(cells)
    return filled


def generated(rows: Rows) -> Rows:
    """Scores of samples, of other true shapes, and of fakes."""
    errors = {row["what"]: row["error"] for row in bench("generate")}

    def line(key: str, *names: str) -> list[str]:
        return ["; ".join(f"{errors[f'{each}: {name}'][key]:.1f}" for name in names) for each in CATEGORIES]

    filled = [line("one_nna_percent", "samples"), line("one_nna_percent", "other true shapes")]
    filled += [line("energy_x1000", "samples"), line("energy_x1000", *FAKES)]
    return [[name, *cells] for (name, *_), cells in zip(rows, filled, strict=True)]


FAKES = ("noisy samples", "blurred samples", "mean shape")
Fill = Callable[[Rows], Rows]


def of(report: str, fill: Callable[..., Rows], *options: Any) -> Fill:
    """Filled from a report's si3dr.csv, of a group of its shapes where it has two."""
    return lambda rows: fill(Measured(report), rows, *options)


TABLES: list[tuple[str, str, Fill]] = [  # page, the line above the table, what fills it: the keys of its numbers
    ("README.md", "On real shapes:", of("real:real", pairs, 1, False)),
    ("docs/results.md", "Real shapes, true camera:", of("real:real", at_camera)),
    ("docs/results.md", "Real shapes, predicted camera:", of("real:real", at_camera, "Pi_pred")),
    ("docs/results.md", "Real shapes, cameras and silhouettes of the DDF:", of("real:real", cameras)),
    ("docs/results.md", "Real shapes, baselines, true camera (more in README):", of("real:real", pairs)),
    ("docs/results.md", "### Where they fail", of("real:real", far)),
    ("README.md", "On procedural shapes:", of("cpu", pairs, 1, False)),
    ("docs/results.md", "### True camera", of("cpu", at_camera)),
    ("docs/results.md", "### Predicted camera", of("cpu", at_camera, "Pi_pred")),
    ("docs/results.md", "Median errors of the predicted camera:", of("cpu", cameras)),
    ("docs/results.md", "### Baselines, true camera", of("cpu", pairs)),
    ("docs/results.md", "At the true camera, the paper's way:", of("cpu_paper", at_camera)),
    ("README.md", "## Why a DDF, and when not", frontier),
    ("docs/results.md", "## One shape", one_shape),
    ("docs/complete.md", "## How well", completed),
    ("docs/complete.md", "## When it is something else", told_apart),
    ("docs/generative.md", "![Eight new chairs](generated_chairs.webp)", generated),
]
SET = {  # tables whose numbers are chosen, not measured: the line above
    ("docs/method.md", "## Where the paper is silent"),
    ("docs/synthetic.md", "# Synthetic shapes"),
}
NUMBER = re.compile(r"\**[-–]?[\d.,]*\d( ?(%|ms|s|°))?\**([;,±] ?.*| ± .*)?")
CLAIMS = [("README.md", "On real shapes:", "real:real"), ("README.md", "On procedural shapes:", "cpu")]


TIMES = [  # page, how its line of times begins, report
    ("README.md", "- Time, procedural shapes: ", "cpu"),
    ("docs/results.md", "- Time, procedural shapes: ", "cpu"),
    ("docs/results.md", "- Time, real shapes: ", "real"),
]


def times(report: str) -> str:
    """What trainings and a test image took, as the report has it."""
    page = (ROOT / "reports" / report / "README.md").read_text()
    trained = re.search(r"(?m)^Wall time of the trainings, summed over categories: (.*)\.$", page)
    image = dict(re.findall(r"(?m)^\| Π<sub>g</sub>, Π̂ \| (\S+) \| ([\d.]+) \|$", page))
    assert trained and list(image) == list(MODELS)
    images = ", ".join(f"{name} {seconds} s" for name, seconds in image.items())
    return f"trainings {trained[1]}; a test image {images}."


def parts(text: str, above: str) -> tuple[str, str, str]:
    """A page before, in and after the rows of the first table below a line."""
    found = re.search(rf"(?ms)^{re.escape(above)}$.*?^\|[ :|-]+\|\n", text)
    assert found, above
    end = re.compile(r"(?m)^(?!\|)").search(text, found.end())
    return text[: found.end()], text[found.end() : end.start() if end else None], text[end.start() if end else None :]


def cells(lines: str) -> Rows:
    """Of the lines of a table."""
    return [line.strip("| ").split(" | ") for line in lines.splitlines()]


def lines_of(rows: Sequence[Sequence[str]]) -> str:
    """What `cells` reads."""
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


if __name__ == "__main__":
    for page, above, fill in TABLES:
        before, table, after = parts((ROOT / page).read_text(), above)
        (ROOT / page).write_text(before + lines_of(fill(cells(table))) + after)
    for page, above, report in CLAIMS:
        before, table, after = parts((ROOT / page).read_text(), above)
        (ROOT / page).write_text(before + table + re.sub(r"\A\n- .*", f"\n- {best(Measured(report))}", after))
    for page, begins, report in TIMES:
        text = (ROOT / page).read_text()
        (ROOT / page).write_text(re.sub(rf"(?m)^{begins}.*$", begins + times(report), text))

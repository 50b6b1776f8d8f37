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

import numpy as np
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from ddf.core import config
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
WHERE = {"true": "Pi_g", "predicted": "Pi_pred"}
NEAR = 90  # F(τ) of a relative, as in reports
PAIRS = {  # rows with D_C and F(τ) in one cell
    "DDF, true camera": ("ddf", "Pi_g-L"),
    "PC-SIREN, true camera": ("pc_siren", "Pi_g-L"),
    "DDF, predicted camera": ("ddf", "Pi_pred-L"),
    "PC-SIREN, predicted camera": ("pc_siren", "Pi_pred-L"),
    "DDF+image, true camera": ("ddf_image", "Pi_g-L"),
    "DDF+image, predicted camera": ("ddf_image", "Pi_pred-L"),
    "DDF, corrected camera": ("ddf", "Pi_corrected-L"),
    "DDF+image, corrected camera": ("ddf_image", "Pi_corrected-L"),
    "DDF, mean latent of three images": ("ddf_3views", "Pi_g-L"),
    "PC-SIREN, mean latent of three images": ("pc_siren_3views", "Pi_g-L"),
    "DDF+image, three images, true cameras": ("ddf_image_3views", "Pi_g-L"),
    "one cloud for all images": ("mean_shape", "Pi_g-L"),
    "retrieval of the nearest training image": ("retrieval", "Pi_g-L"),
    "ceiling: the truth against itself": ("ceiling", "Pi_g-L"),
    "oracle: the best training shape": ("oracle_retrieval", "Pi_g-L"),
}
COMPLETED = ("chair", "plane")  # by `ddf complete`
HARD = ("depth, 1 % noise", "depth, 2 % noise", "depth, 10 % outliers", "lidar")
CAMERAS = {  # median errors
    "azimuth, degrees": ("ddf", "Pi_pred", "azimuth_error_deg_median", 1),
    "turned round, % of images": ("ddf", "Pi_pred", "azimuth_turned_x100", 0),
    "IoU of the silhouette": ("ddf", "Pi_pred", "silhouette_iou", 2),
    "azimuth after the correction by the mask": ("ddf", "Pi_corrected", "azimuth_error_deg_median", 1),
    "elevation, degrees": ("ddf", "Pi_pred", "elevation_error_deg_median", 2),
    "DDF+image: azimuth, degrees": ("ddf_image", "Pi_pred", "azimuth_error_deg_median", 1),
    "DDF+image: corrected": ("ddf_image", "Pi_corrected", "azimuth_error_deg_median", 1),
    "DDF+image: radius": ("ddf_image", "Pi_pred", "radius_error_median", 3),
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


def at_camera(measured: Measured, rows: Rows) -> Rows:
    """All models by metric, true camera; bold: where the report claims a difference."""
    filled = []
    for label, group in itertools.groupby(rows, key=lambda row: row[0]):
        metric, digits = METRICS[label]
        names = [row[1] for row in group]
        cells = {name: [label, name] for name in names}
        for category in CATEGORIES:
            keys = {name: (category, MODELS[name], "Pi_g-L", metric) for name in names}
            for name, key in keys.items():
                text = measured.text(*key, digits=digits)
                cells[name].append(f"**{text}**" if key in measured.claims else text)
        filled += cells.values()
    return filled


def cameras(measured: Measured, rows: Rows) -> Rows:
    """Median errors of cameras."""
    told = [(name, *CAMERAS[name]) for name, *_ in rows]
    return [[name, *(measured.text(c, *key, digits=digits) for c in CATEGORIES)] for name, *key, digits in told]


def far(measured: Measured, rows: Rows) -> Rows:
    """Of the report's test shapes beside their nearest training shapes, those of the DDF."""
    lines = {line[0]: line for line in cells(parts(measured.page, "## Far from the training shapes")[1])}
    _, shapes, ranks, above, *_ = zip(*(lines[f"{measured.group} {c}"] for c in CATEGORIES), strict=True)
    counts = [f"{some} of {every}" for some, every in zip(above, shapes, strict=True)]
    return [[name, *values] for (name, *_), values in zip(rows, (ranks, counts), strict=True)]


def relatives(measured: Measured, rows: Rows) -> Rows:
    """F(τ) of the models over planes that the nearest training shape comes near, and over the others."""
    scores, models = recomputed.Scores(measured.folder), (*MODELS.values(), "oracle_retrieval")
    *found, known = (
        scores.of((f"{measured.group} plane", own, "Pi_g-L", PRINTED["F(τ)"]))[0].mean(0) for own in models
    )
    near = known > NEAR
    return [
        [f"{name.partition(',')[0]}, {which.sum()}", *(f"{each[which].mean():.1f}" for each in found)]
        for (name, *_), which in zip(rows, (near, ~near), strict=True)
    ]


def favours(rows: Rows) -> Rows:
    """The choices, with how much longer DDF+image was trained."""
    longer = f"{ratio('cpu'):.2f} (procedural), {ratio('real'):.2f} (real)"
    return [[f"Minutes of training, × {longer}", *row[1:]] if row[0].startswith("Minutes") else row for row in rows]


def best(measured: Measured) -> str:
    """Which model has the best means of D_C and F(τ) at both cameras, and which are claimed to be better, or worse."""
    found, claimed = Counter[str](), {1: dict[str, list[str]](), -1: dict[str, list[str]]()}
    scores = recomputed.Scores(measured.folder) if measured.open else None
    verdicts = scores.verdicts(next(recomputed.tables(measured.page))) if scores else {}
    for camera, category, metric in itertools.product(("true", "predicted"), CATEGORIES, ("D_C", "F(τ)")):
        column, (name, digits), less = f"{WHERE[camera]}-L", METRICS[metric], metric == "D_C"
        keys = {model: (category, own, column, name) for model, own in MODELS.items()}
        there = {model: measured.value(*key) for model, key in keys.items() if key in measured.rows}
        found[(min if less else max)(there, key=lambda model: there[model])] += 1
        for model, value in there.items():
            cell = (f"{measured.group} {category}".strip(), MODELS[model], column, PRINTED[metric])
            if scores and (way := verdicts.get(cell)):
                told, known = scores.told(cell, way), (category, "retrieval", "Pi_g-L", name)
                if way > 0 and known in measured.rows and (measured.value(*known) < value) == less:
                    shown = measured.text(*known, digits=digits - (not less), spread=False)
                    told += f"; retrieval by the true camera: {shown}"
                claimed[way].setdefault(f"{model}, {camera} camera", []).append(f"{category} {metric} ({told})")
    most = ", ".join(f"{name} {count}" for name, count in found.most_common())
    means = f"Best of the models' {found.total()} means of one image: {most}."
    if not measured.open:
        return f"{means}\n- Claimed none: scores per image of this run were not kept."
    better, worse = (
        "; ".join(f"{who}: {', '.join(cells)}" for who, cells in claimed[way].items()) or "none" for way in (1, -1)
    )
    means += f"\n- Claimed better than both other models by one image: {better}."
    return f"{means}\n- Claimed worse than both: {worse}."


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


def bytes_of_rock() -> str:
    """Of the finer grid and of patches."""
    rows = {row["what"]: row for row in bench("frontier") if row["size"]["shape"] == "rock 10,000"}
    grid, patches = (rows[name] for name in ("distances, 256", "patches, 0.0003"))
    assert grid["error"]["depth_median"] < patches["error"]["depth_median"]
    return f"{grid['bytes'] / 1e6:.0f} MB for their {patches['bytes'] / 1e6:.1f}."


def one_view(rows: Rows) -> Rows:
    """Of the fields of one image: wrong rays of those from inside, and how far normals are off."""
    found = {row["what"]: row["error"] for row in bench("one_view")}
    kinds = [(name, "patches" if "patches" in name else name) for name, *_ in rows]
    errors = [(name, [found[f"{category}: {kind}"] for category in CATEGORIES]) for name, kind in kinds]
    return [[name, *(f"{each['inside']:.0f} %, {each['normals']:.0f}°" for each in own)] for name, own in errors]


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
    """D_C, F(τ), and the gain in F(τ) over the image with its interval, of rows whose scores are kept by shape."""
    kinds = {
        "from the image": "image",
        "mean": "mean",
        "nearest": "nearest",
        "weaker": "sdf, 4000 steps, prior 0.01",
        "signed": "sdf",
    }
    found, filled = scanned(), []
    for name, *_ in rows:
        kind, cells = next((own for word, own in kinds.items() if word in name), "depth"), [name]
        for category in COMPLETED:
            error = found[category, kind]["error"]
            cells.append(f"{error[CHAMFER]:.3f}, {error[F_TAU]:.1f}")
            if "each" in found[category, kind] and kind != "image":
                mean, deviation, freedom = over_image(category, F_TAU, kind)
                cells[-1] += f", {mean:.1f} ± {stats.t.ppf(0.975, freedom) * deviation:.1f}"
        filled.append(cells)
    return filled


def scanned() -> dict[tuple[str, str], dict]:
    """The rows of test shapes of the benchmark of `ddf complete`, by category and way."""
    return {tuple(row["what"].split(", test: ")): row for row in bench("complete")}


def over_image(category: str, metric: str, kind: str = "depth") -> tuple[float, float, float]:
    """By how much a score is above that from the image: mean over shapes, its standard error, degrees of freedom."""
    first, second = (np.array(scanned()[category, way]["each"][metric]) for way in (kind, "image"))
    paired = first - second[: len(first)]
    return paired.mean(), paired.std(ddof=1) / np.sqrt(paired.size), paired.size - 1


def gains() -> str:
    """Where a scan is claimed to be better than an image, and where to be worse."""
    gaps = {(c, m): over_image(c, m) for c in COMPLETED for m in (CHAMFER, F_TAU)}
    left = recomputed.held({key: recomputed.chance(*gap) for key, gap in gaps.items()})
    names = {CHAMFER: "D<sub>C</sub>", F_TAU: "F"}
    said = {True: list[str](), False: list[str]()}
    for c, m in sorted(left):
        said[(gaps[c, m][0] > 0) == (m == F_TAU)].append(f"{c}s by {names[m]}")
    better, worse = (" and ".join(said[way]) or "none" for way in (True, False))
    return f"a scan is better than an image for {better}; worse for {worse}."


def seconds() -> str:
    """Of completions by all scans, whether the pose is known or sought."""
    kinds = ("depth", "lidar", "told apart")
    every = [row["median_s"] for (_, way), row in scanned().items() if way.startswith(kinds)]
    own = f"{min(every):.0f} to {max(every):.0f} s of one core, the pose known or sought"
    return f"{own}; `ddf complete` with cloud and pictures some 12 to 20 s."


def hard(category: str, metric: str, digits: int) -> str:
    """The range of an error over scans with noise, outliers or a lidar."""
    every = [row["error"][metric] for (c, way), row in scanned().items() if c == category and way in HARD]
    assert len(every) == len(HARD)
    return f"{min(every):.{digits}f} to {max(every):.{digits}f}"


def intervals() -> str:
    """What they hold, how wide they are."""
    chair, plane = (scanned()[category, "depth"]["error"] for category in COMPLETED)
    halves = [row["error"]["coverage_50"] for row in scanned().values() if "coverage_50" in row["error"]]
    return (
        f"{chair['coverage_90']:.0f} % (chairs) and {plane['coverage_90']:.0f} % (planes) end in intervals of 90 %, "
        f"a median of {chair['width_90']:.2f} and {plane['width_90']:.2f} half sides wide; with noise, outliers or "
        f"lidar {' and '.join(hard(category, 'coverage_90', 1) for category in COMPLETED)} %. Over 90 %: too "
        f"wide. Intervals of 50 % hold {min(halves):.0f} to {max(halves):.0f} %."
    )


def spreads() -> str:
    """Of seen points of clouds, beside the noise."""
    every = [row["error"]["seen_over_noise"] for row in scanned().values() if "seen_over_noise" in row["error"]]
    return f"{min(every):.1f} to {max(every):.1f} times the noise."


def harder() -> str:
    """Scores with noise, outliers or a lidar."""
    (chairs, chair), (planes, plane) = ([hard(c, F_TAU, 1), hard(c, CHAMFER, 3)] for c in COMPLETED)
    few = scanned()["chair", "lidar"]["size"]["shapes"]
    return f"the first {few} chairs reach F {chairs}, D<sub>C</sub> {chair}, {few} planes {planes}, {plane}."


def pose_off() -> str:
    """What is left of a wrong pose."""
    chair, plane = (scanned()[category, "depth, pose off"]["error"] for category in COMPLETED)
    left, other = (f"{each['angle_deg']:.1f} degrees and {each['scale_percent']:.1f} %" for each in (chair, plane))
    return f"a median of {left} was left for chairs, F {chair[F_TAU]:.1f}; {other} for planes, F {plane[F_TAU]:.1f}."


def older() -> str:
    """Whether rows of signed distances are of older code than the others."""
    rows = [row for (_, way), row in scanned().items() if way.startswith("sdf")]
    return "" if all("code" in row for row in rows) else f" Its {len(rows)} rows are older than the others."


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
    ("docs/results.md", "Real shapes, cameras, and silhouettes of the DDF:", of("real:real", cameras)),
    ("docs/results.md", "Rays from inside the box that are wrong, normals, true camera:", one_view),
    ("docs/results.md", "### Where they fail", of("real:real", far)),
    (
        "docs/results.md",
        f"Real planes whose nearest training shape has F(τ) over {NEAR}, and others, true camera, F(τ):",
        of("real:real", relatives),
    ),
    ("docs/results.md", "## Choices that favour one model", favours),
    ("README.md", "On procedural shapes:", of("cpu", pairs, 1, False)),
    ("docs/results.md", "### True camera", of("cpu", at_camera)),
    ("docs/results.md", "Predicted camera, median errors:", of("cpu", cameras)),
    ("docs/results.md", "The best training shape, true camera:", of("cpu", pairs)),
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


def related() -> str:
    """Of the real shapes that the package's models learned, those of makers of test shapes, as the cards have them."""
    said = []
    for name in CATEGORIES:
        card = (ROOT / "src" / "ddf" / "shipped" / name / "card.md").read_text()
        if found := re.search(r"(?m)^- (\d+ of \d+) shapes of other people are of makers", card):
            said.append(f"{found[1]} {name}s")
    return f"{', '.join(said)}."


def papers_way() -> str:
    """How many means of PC-SIREN are better than the DDF's at the true camera, by the paper's losses and samples."""
    found, won = Measured("cpu_paper"), 0
    for category, (metric, less) in itertools.product(CATEGORIES, ((CHAMFER, True), (F_TAU, False))):
        ours, theirs = (found.value(category, own, "Pi_g-L", metric) for own in ("ddf", "pc_siren"))
        won += (theirs < ours) == less
    return f"{won} of 6 means of PC-SIREN are better than DDF's at the true camera, one training of each."


RELATED = "The package's models learned real shapes by makers of test shapes too: "
LINES: list[tuple[str, str, Callable[[], str]]] = [  # page, how a line begins, what it says then
    (
        "README.md",
        "- Minutes and seconds: [results](docs/results.md#budget-and-time). DDF+image trained for ",
        lambda: f"{ratio('cpu'):.2f} times the others' minutes; on real shapes {ratio('real'):.2f} times.",
    ),
    (
        "README.md",
        "- Against an SDF: a network asks once a ray; patches walk an octree. An SDF knows inside and outside. Patches "
        "are better at thin parts; on the rock 256³ is nearer, in ",
        bytes_of_rock,
    ),
    ("README.md", "- With the paper's own losses and samples at these sizes, ", papers_way),
    ("README.md", RELATED, related),
    ("docs/complete.md", f"- {RELATED}", related),
    ("docs/results.md", "- Time, procedural shapes, minutes of all three categories: ", lambda: times("cpu")),
    ("docs/results.md", "- Time, real shapes, minutes of all three categories: ", lambda: times("real")),
    ("docs/complete.md", "- Gains: paired, ± half the interval of 95 %. Claimed (Student's t, Holm): ", gains),
    ("docs/complete.md", "- A completion takes ", seconds),
    ("docs/complete.md", "- Of all hit rays of another view ", intervals),
    ("docs/complete.md", "- Seen points are no surer than inferred ones; their spread is ", spreads),
    ("docs/complete.md", "- With noise of 1 or 2 % of the diagonal, a tenth of outliers, or 496 lidar rays, ", harder),
    ("docs/complete.md", "- A pose off by 30 degrees, 10 % of the size and 5 % in place: ", pose_off),
    (
        "docs/complete.md",
        "- Signed distances: an auto-decoder of the same size on the same shapes, trained as long; a descent on its "
        "latent asks it for as many values.",
        older,
    ),
]


def trained(report: str) -> dict[str, float]:
    """Minutes of training by model, as the report has them."""
    page = (ROOT / "reports" / report / "README.md").read_text()
    line = re.search(r"(?m)^Wall time of the trainings, summed over categories.*?: (.*)\.$", page)
    assert line
    return {name: float(minutes) for name, minutes in re.findall(r"(\S+) ([\d.]+) min", line[1])}


def ratio(report: str) -> float:
    """How much longer than the mean of the others DDF+image was trained."""
    *others, longer = (trained(report)[name] for name in MODELS)
    return longer / (sum(others) / len(others))


def steps(report: str, section: str) -> int:
    """Of a training, as the experiment of the report's name has them."""
    layers = config.layers(ROOT / "configs" / f"{report}.yaml")[section]
    return next(given["steps"] for _, given in reversed(layers) if "steps" in given)


def times(report: str) -> str:
    """What trainings and a test image took, as the report has it, and the steps of its experiment."""
    page = (ROOT / "reports" / report / "README.md").read_text()
    image = dict(re.findall(r"(?m)^\| Π<sub>g</sub>, Π̂ \| (\S+) \| ([\d.]+) \|$", page))
    assert list(image) == list(MODELS)
    sections = [method.replace("pc_siren", "pcsiren") for method in MODELS.values()]
    taken = [
        f"{name} {trained(report)[name]:.1f} min ({steps(report, own):,}{' steps' * (name == 'DDF')})"
        for name, own in zip(MODELS, sections, strict=True)
    ]
    images = ", ".join(f"{name} {seconds} s" for name, seconds in image.items())
    return f"trainings {', '.join(taken)}, {ratio(report):.2f} times the others'; a test image {images}."


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
        (ROOT / page).write_text(
            before + table + re.sub(r"\A\n- .*(\n- Claimed .*)*", f"\n- {best(Measured(report))}", after)
        )
    for page, begins, fill in LINES:
        text = (ROOT / page).read_text()
        before, found, after = text.partition(f"\n{begins}")
        assert found, begins
        (ROOT / page).write_text(f"{before}{found}{fill()}\n{after.partition(chr(10))[2]}")

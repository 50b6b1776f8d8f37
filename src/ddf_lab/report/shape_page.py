"""The page of a single-shape experiment: pictures, held-out errors, diagnostics, sample types left out, training.

Everything comes from what the stages `fit_shape` and `ablate_samples` wrote.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from ddf.core import storage
from ddf.fit import field_diagnostics, fit_folder, fit_settings
from ddf.training import training_loop
from ddf_lab.evaluation import paper_results, shape_fits
from ddf_lab.evaluation.shape_fits import ALL, MEASURED, TYPES
from ddf_lab.report import figures, pages, shape_views
from ddf_lab.run import Run

METRIC_NAMES = {"depth_l1_x10": "L1 × 10 of depth", "visibility_bce": "BCE of visibility"}
SOURCES = {MEASURED: "here", paper_results.BUNNY: paper_results.BUNNY}
_DIAGNOSTICS = {
    "eikonal_depth": ("directed eikonal, depth", "|∇<sub>p</sub>d · v + 1|"),
    "eikonal_visibility": ("directed eikonal, visibility", "|∇<sub>p</sub>ξ · v|"),
    "gradient_consistency": ("gradient consistency", "‖(∇<sub>v</sub>d - d ∇<sub>p</sub>d)(I - vvᵀ)‖"),
    "view_depth": ("view consistency, depth", "max(0, d(p₂, v₂) - t)"),
    "view_visibility": ("view consistency, visibility", "1 - ξ(p₂, v₂)"),
}


def write(run: Run, fit: fit_settings.FitConfig) -> None:
    """README.md, both tables and the pictures.

    Raises:
      FileNotFoundError: a stage has not run.
    """
    folder, ablated = run.folder("fit_shape"), run.folder("ablate_samples")
    metrics = storage.read_json(folder / fit_folder.METRICS)
    errors, left_out = (
        storage.load_table(path)[0] for path in (folder / shape_fits.FIT, ablated / shape_fits.ABLATION)
    )
    pictures = {name: (folder / name).read_bytes() for name in (shape_views.VIEWS, shape_views.SLICES)}
    shape = "a procedural chair" if fit.mesh is None else f"`{Path(fit.mesh).name}`"
    views = pages.Figure(
        shape_views.VIEWS,
        "The field and the mesh that it was fitted to, from three cameras. Below each name: azimuth, elevation, "
        "distance of the camera (0.57 is the box's diagonal), rays that met the box.",
        "visibility, depth, normals and curvature of the field from three cameras",
        pictures[shape_views.VIEWS],
    )
    about = (
        f"Experiment `{run.name}`: one directed distance field for one shape, {shape}.",
        f"Made by `make fit-shape CONFIG={run.name}`. Numbers are in [fit.csv](fit.csv) and "
        "[ablate_samples.csv](ablate_samples.csv).",
        "One seed, one shape, and not the paper's: `ddf config show paper_fit` has its sizes, losses and steps; `fit` "
        "has a small fraction of them.",
    )
    measured = errors.set_index(["metric", "source", "type"])["value"].sort_index()
    sections = [
        _pictures_section(pictures[shape_views.SLICES]),
        _errors_section(measured, fit),
        pages.Section("Consistency", [diagnostics_table(storage.read_json(folder / shape_views.DIAGNOSTICS))]),
        _ablation_section(left_out, storage.read_json(ablated / shape_fits.RESULTS)),
        _training_section(metrics, pd.DataFrame(training_loop.read_log(folder))),
    ]
    pages.write(pages.Page(f"A field of one shape: {run.name}", [verdict(measured), views, about], sections), run.page)
    for name, table in ((shape_fits.FIT, errors), (shape_fits.ABLATION, left_out)):
        storage.write_text(run.page / name, table.to_csv(index=False, lineterminator="\n"))


def verdict(errors: pd.Series) -> str:
    """What the held-out errors say."""
    off = errors["depth_l1_x10", MEASURED, "U"] / 10 / 2  # of half the side, times 10
    if pd.isna(off):
        return "No held-out ray of type U meets the shape."
    return f"On rays from anywhere in the box (U) depth is off by {100 * off:.1f} % of its longest side in the mean."


def _pictures_section(slices: bytes) -> pages.Section:
    levels = " and ".join(f"{100 * level:.0f} %" for level in shape_views.SLICE_LEVELS)
    picture = pages.Figure(
        shape_views.SLICES,
        f"The field on two planes z = const ({levels} of the box): every pixel a start p, one direction v a row. "
        "White: nothing is seen. The depth jumps where p moves through the surface.",
        "visibility, weight, depth and true depth on two planes through the shape, for three directions",
        slices,
    )
    reading = (
        "Depth: yellow is near, one scale a row. Normals: (n + 1)/2 as RGB. Mean curvature: red is hollow, blue bulges "
        "towards the viewer.",
        "n₁, n₂: normals of both components. The lighter one may model the surface behind; then that shows. w₁: red "
        "where component 1 gives the depth, blue where component 2 does.",
    )
    return pages.Section("Pictures", [picture, reading])


def _errors_section(errors: pd.Series, fit: fit_settings.FitConfig) -> pages.Section:
    caption = (
        f"Errors on {fit.held_out:,} held-out samples of each type. Depth: mean |d - d̂| × 10 over visible samples, in "
        "units of half the box's longest side. Visibility: cross-entropy, natural logarithm. The paper's fit is to the "
        "Stanford bunny, table `dataablation`, with 500,000 samples and 100,000 steps: not comparable cell by cell."
    )
    rows = [
        [name, where, *(number(errors[metric, source, kind]) for kind in TYPES)]
        for metric, name in METRIC_NAMES.items()
        for source, where in SOURCES.items()
    ]
    table = pages.Table(caption, ["", "", *_held_out(TYPES)], rows, labels=2)
    median, p95 = (errors[f"normal_angle_deg_{name}", MEASURED] for name in ("median", "p95"))
    kinds = [kind for kind in (*TYPES, ALL) if kind in median]  # those that have true normals, and all these together
    caption = "Angle between the field's normals and the true ones, over visible held-out samples."
    rows = [[name, *(number(own[kind], "°", 1) for kind in kinds)] for name, own in (("median", median), ("95 %", p95))]
    return pages.Section("Held-out errors", [table, pages.Table(caption, ["", *_held_out(kinds)], rows)])


def _held_out(kinds: Sequence[str]) -> list[str]:
    return [f"held-out {'U, A, B' if kind == ALL else kind}" for kind in kinds]


def diagnostics_table(found: Mapping[str, Mapping[str, float]]) -> pages.Table:
    """Residuals of `field_diagnostics.measure`."""
    rows = []
    for name in field_diagnostics.NAMES:
        numbers = [number(found[name][key]) for key in ("median", "p95", "worst")]
        rows.append([*_DIAGNOSTICS[name], *numbers, f"{found[name]['rays']:,}"])
    caption = (
        "How far the field is from being a DDF at all, on random rays of the box, in units of half its longest side: "
        "each row is an identity of every exact DDF. Derivatives of an exact field grow without bound towards grazing "
        "rays. View consistency: a point q₁ that (p₁, v₁) sees is looked at from another start, q₁ = p₂ + t v₂. It, or "
        "something before it, must be seen."
    )
    return pages.Table(caption, ["", "0 for an exact field", "median", "95 %", "worst", "rays"], rows, labels=2)


def _ablation_section(left_out: pd.DataFrame, fits: Mapping[str, Mapping[str, Any]]) -> pages.Section:
    tables = [ablation_table(left_out, metric, name) for metric, name in METRIC_NAMES.items()]
    most, steps = max(found["samples"] for found in fits.values()), fits[shape_fits.NONE]["steps"]
    budgets = (
        f"Here every fit has {most:,} samples or less by rounding, all types together, and {steps:,} steps; the "
        "paper's have 500,000 and 100,000 on the Stanford bunny. Errors: [ablate_samples.csv](ablate_samples.csv)."
    )
    return pages.Section("Sample types left out", [*tables, budgets])


def ablation_table(table: pd.DataFrame, metric: str, name: str) -> pages.Table:
    """One metric of ablate_samples.csv: a row per left-out type, a column per held-out type, its largest error bold."""
    chosen = table[(table["metric"] == metric) & (table["source"] == MEASURED)]
    values = chosen.pivot(index="without", columns="type", values="value")
    rows = [
        [without, *(pages.Cell(number(own[kind]), bool(own[kind] == values[kind].max())) for kind in TYPES)]
        for without, own in values.loc[[*TYPES, shape_fits.NONE]].iterrows()
    ]
    caption = f"{name}, here: trained without a type (rows), asked for a type (columns). Bold: a column's worst."
    return pages.Table(caption, ["left out", *_held_out(TYPES)], rows)


def _training_section(metrics: Mapping[str, Any], log: pd.DataFrame) -> pages.Section:
    picture = pages.Figure(
        "losses.svg",
        "Total loss (thick, smoothed) and its terms without their weights. What may be below 0 is drawn higher by 1.",
        "falling curves of the total loss and of its terms over the steps",
        figures.loss_curves({"DDF": {"one shape": log}}).encode(),
    )
    told = (
        f"{metrics['parameters']:,} parameters, {metrics['steps']:,} steps; sampling took "
        f"{metrics['sampling_seconds']:.0f} s, training {log['seconds'].iloc[-1]:.0f} s."
    )
    return pages.Section("Training", [picture, told])


def number(value: float | None, unit: str = "", digits: int | None = None) -> str:
    """Two decimals, as the paper prints, more where that says 0, or `digits`; a dash for a mean over nothing."""
    if value is None or pd.isna(value):
        return "–"
    if digits is None:
        return f"{value:.2f}" if value == 0 or abs(value) >= 0.095 else f"{value:.2g}"
    return f"{value:.{digits}f}{unit}"

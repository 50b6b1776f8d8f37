"""The page of a single-shape experiment: pictures, held-out errors, diagnostics, sample types left out, training.

Everything comes from what the stages `fit_shape` and `ablate_samples` wrote.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pandas as pd

from ddf.core import storage
from ddf.fit import fit_settings, fitting
from ddf.training import training_loop
from ddf_lab.evaluation.shape import fit_errors, leave_one_out, paper_ablation
from ddf_lab.evaluation.shape.fit_errors import MEASURED, TYPES
from ddf_lab.report import figures, pages
from ddf_lab.report.shape import shape_tables, shape_views
from ddf_lab.report.shape.shape_results import DIAGNOSTICS, SLICES, VIEW_RECORD, VIEWS
from ddf_lab.run import Run

CURVES = "losses.svg"

_LEAD: Final = (
    "Experiment `{name}`: one directed distance field for one shape, {shape}.",
    "Made by `make fit-shape CONFIG=configs/{name}.yaml`. Numbers are in [fit.csv](fit.csv) and "
    "[ablate_samples.csv](ablate_samples.csv).",
    "`ddf render artifacts/{name}/fit_shape OUT.png` draws more.",
)
_VERDICT: Final = (
    "{depth} Of the twelve held-out errors, {lower} are below those of the paper's fit, which is of another shape."
)
_DEPTH_OFF: Final = (
    "On rays from anywhere in the box (U) depth is off by {percent} % of the box's longest side in the mean."
)
_VIEWS: Final = "The field and the mesh that it was fitted to, from four cameras. No post-processing."
_READING_VIEWS: Final = (
    "Below each name: azimuth, elevation, distance of the camera (0.57 is the box's diagonal), rays that met the box.",
    "The camera looks at the box's centre.",
    "Depth: yellow is near, one scale a row. Normals: (n + 1)/2 as RGB.",
    "n₁, n₂: normals of both components. The lighter one may model the surface behind; then that shows.",
    "Mean curvature: red is hollow, blue bulges towards the viewer.",
    "w₁: red where component 1 gives the depth, blue where component 2 does.",
)
_SLICES: Final = (
    "The field on two planes z = const ({levels} of the box): every pixel a start p, one direction v a row."
)
_READING_SLICES: Final = (
    "As the paper's figure 1: visibility ξ, w₁, depth and true depth.",
    "White: nothing is seen. Outside the box nothing is asked.",
    "The depth jumps where p moves through the surface.",
)
_ERRORS: Final = "Errors on {held_out} held-out samples of each type."
_ANGLES: Final = "Angle between the field's normals and the true ones, over visible held-out samples."
_READING_ERRORS: Final = (
    "Depth: mean |d - d̂| × 10 over visible samples, in units of half the box's longest side.",
    "Visibility: cross-entropy, natural logarithm.",
    "{paper}: the paper's fit to the Stanford bunny, table `dataablation`, 500,000 samples and 100,000 steps.",
    "That is another shape and another budget, not comparable cell by cell.",
)
_DIAGNOSTICS_TEXT: Final = "How far the field is from being a DDF at all, on random rays of the box."
_READING_DIAGNOSTICS: Final = (
    "Each row is an identity of every exact DDF. No truth is needed.",
    "Depths are in units of half the box's longest side.",
    "Derivatives of an exact field grow without bound towards grazing rays: the worst values are those of single rays.",
    "View consistency: a point q₁ that (p₁, v₁) sees is looked at from another start, q₁ = p₂ + t v₂. It, or something "
    "before it, must be seen.",
)
_ABLATION: Final = (
    "{metric}, {where}: trained without a type (rows), asked for a type (columns). Bold: a column's worst."
)
_BUDGETS: Final = (
    "Here every fit has {samples} samples or less by rounding, all types together, and {steps} steps.",
    "The paper's fits have 500,000 samples and 100,000 steps on the Stanford bunny.",
)
_ITSELF: Final = (
    "{metric}: leaving a type out is worst of all for that type {count} of {whole} times ({types}); in the paper "
    "{paper_count} ({paper_types})."
)
_CURVES: Final = "Total loss (thick, smoothed) and its terms without their weights."
_LIMITS: Final = (
    "One seed, one shape, and not the paper's.",
    "`ddf config show paper_fit` has the paper's sizes, losses and steps; `fit` has a small fraction of them.",
    "Budgets in minutes give as many steps as the machine manages: another machine fits a little better or worse.",
)


@dataclass(frozen=True)
class Results:
    """What the stages left behind; `ablation` by left-out type, `source` names the mesh's file."""

    name: str
    source: str | None
    metrics: dict[str, Any]
    log: pd.DataFrame
    errors: pd.DataFrame
    diagnostics: dict[str, dict[str, float]]
    views: list[dict[str, Any]]
    ablation: dict[str, dict[str, Any]]
    ablation_errors: pd.DataFrame


def read(run: Run, fit: fit_settings.FitConfig) -> Results:
    """Everything that the page says.

    Raises:
      FileNotFoundError: a stage has not run.
    """
    folder = run.folder("fit_shape")
    ablated = run.folder("ablate_samples")
    return Results(
        name=run.name,
        source=None if fit.mesh is None else Path(fit.mesh).name,
        metrics=storage.read_json(folder / fitting.METRICS),
        log=pd.DataFrame(training_loop.read_log(folder)),
        errors=storage.load_table(folder / fit_errors.FIT)[0],
        diagnostics=storage.read_json(folder / DIAGNOSTICS),
        views=storage.read_json(folder / VIEW_RECORD),
        ablation=storage.read_json(ablated / leave_one_out.RESULTS),
        ablation_errors=storage.load_table(ablated / fit_errors.ABLATION, keep_default_na=False)[0],
    )


def write(run: Run, fit: fit_settings.FitConfig) -> None:
    """README.md, both tables and the pictures."""
    results = read(run, fit)
    folder = run.folder("fit_shape")
    page = build(results, fit, {name: (folder / name).read_bytes() for name in (VIEWS, SLICES)})
    for name, table in ((fit_errors.FIT, results.errors), (fit_errors.ABLATION, results.ablation_errors)):
        storage.write_text(run.page / name, table.to_csv(index=False, lineterminator="\n"))
    pages.write(page, run.page)


def build(results: Results, fit: fit_settings.FitConfig, pictures: dict[str, bytes]) -> pages.Page:
    """The page from results already read; `pictures` by file name."""
    shape = "a procedural chair" if results.source is None else f"`{results.source}`"
    views = pages.Figure(
        VIEWS, _VIEWS, "visibility, depth, normals and curvature of the field from four cameras", pictures[VIEWS]
    )
    lead = [verdict(results), views, tuple(text.format(name=results.name, shape=shape) for text in _LEAD)]
    sections = [
        _pictures_section(pictures[SLICES]),
        _errors_section(results, fit),
        _consistency_section(results),
        _ablation_section(results),
        _training_section(results),
        pages.Section("What does not reproduce", [_LIMITS]),
    ]
    return pages.Page(f"A field of one shape: {results.name}", lead, sections)


def verdict(results: Results) -> str:
    """What the held-out errors say, in two sentences."""
    table = results.errors[results.errors["metric"].isin(shape_tables.METRIC_NAMES)]
    ours, paper = (
        table[table["source"] == source].set_index(["metric", "type"])["value"]
        for source in (MEASURED, paper_ablation.SOURCE)
    )
    off = ours["depth_l1_x10", "U"] / 10 / 2  # of half the side, times 10
    depth = (
        "No held-out ray of type U meets the shape." if pd.isna(off) else _DEPTH_OFF.format(percent=f"{100 * off:.1f}")
    )
    return _VERDICT.format(depth=depth, lower=int((ours < paper.reindex(ours.index)).sum()))


def _pictures_section(slices: bytes) -> pages.Section:
    levels = " and ".join(f"{100 * level:.0f} %" for level in shape_views.SLICE_LEVELS)
    alt = "visibility, weight, depth and true depth on two planes through the shape, for three directions"
    picture = pages.Figure(SLICES, _SLICES.format(levels=levels), alt, slices)
    return pages.Section("Pictures", ["Of the picture above:", _READING_VIEWS, picture, _READING_SLICES])


def _errors_section(results: Results, fit: fit_settings.FitConfig) -> pages.Section:
    table = shape_tables.errors(results.errors, _ERRORS.format(held_out=f"{fit.held_out:,}"))
    angles = shape_tables.angles(results.errors, _ANGLES)
    paper = paper_ablation.SOURCE.capitalize()
    return pages.Section("Held-out errors", [table, angles, tuple(t.format(paper=paper) for t in _READING_ERRORS)])


def _consistency_section(results: Results) -> pages.Section:
    table = shape_tables.diagnostics(results.diagnostics, _DIAGNOSTICS_TEXT)
    return pages.Section("Consistency", [table, _READING_DIAGNOSTICS])


def _ablation_section(results: Results) -> pages.Section:
    tables, findings = [], []
    for metric, name in shape_tables.METRIC_NAMES.items():
        for source, where in ((MEASURED, "here"), (paper_ablation.SOURCE, paper_ablation.SOURCE)):
            caption = _ABLATION.format(metric=name, where=where)
            tables.append(shape_tables.ablation(results.ablation_errors, metric, source, caption))
        ours, theirs = (
            shape_tables.worst_for_itself(results.ablation_errors, metric, source)
            for source in (MEASURED, paper_ablation.SOURCE)
        )
        words = {"count": len(ours), "types": _listed(ours), "paper_count": len(theirs), "paper_types": _listed(theirs)}
        findings.append(_ITSELF.format(metric=name, whole=len(TYPES), **words))
    most = max(found["samples"] for found in results.ablation.values())
    steps = results.ablation[leave_one_out.NONE]["steps"]
    budgets = (text.format(samples=f"{most:,}", steps=f"{steps:,}") for text in _BUDGETS)
    return pages.Section("Sample types left out", [tuple(findings), *tables, tuple(budgets)])


def _listed(kinds: list[str]) -> str:
    return ", ".join(kinds) or "none"


def _training_section(results: Results) -> pages.Section:
    metrics, log = results.metrics, results.log
    rays, evaluated = (sum(view[key] for view in results.views) for key in ("rays", "evaluated"))
    rows = [
        ["parameters", f"{metrics['parameters']:,}"],
        ["steps", f"{metrics['steps']:,}"],
        ["sampling", f"{metrics['sampling_seconds']:.0f} s"],
        ["training", f"{log['seconds'].iloc[-1]:.0f} s"],
        ["last loss (mean of 5 %)", f"{log.tail(max(1, len(log) // 20))['loss'].mean():.4f}"],
        ["rays of the views", f"{rays:,}"],
        ["rays evaluated", f"{evaluated:,}"],
        ["rays saved by the box", f"{rays - evaluated:,} ({100 * (rays - evaluated) / rays:.0f} %)"],
    ]
    table = pages.Table("The fit, and what the renders above cost.", ["", ""], rows)
    drawn = figures.loss_curves({"DDF": {"one shape": log}}).encode()
    picture = pages.Figure(CURVES, _CURVES, "falling curves of the total loss and of its terms over the steps", drawn)
    return pages.Section("Training", [picture, table])

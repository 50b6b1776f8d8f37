"""The page of a single-shape experiment: pictures, held-out errors, diagnostics, sample types left out, training.

Everything comes from what the stages `fit_shape` and `ablate_samples` wrote.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pandas as pd

from ddf.core import config, storage
from ddf.report import figures, pages
from ddf.report.shape import shape_tables, shape_views
from ddf.report.shape.shape_results import DIAGNOSTICS, SLICES, VIEW_RECORD, VIEWS
from ddf.shape import fit_errors, fitting, leave_one_out, paper_ablation
from ddf.shape.fit_errors import MEASURED, TYPES
from ddf.training import training_loop

CURVES = "losses.svg"

_LEAD: Final = "One directed distance field for one shape: {shape}. Experiment `{name}`."
_SOURCE: Final = """
Made by `make fit-shape CONFIG=configs/{name}.yaml`. Numbers are in [fit.csv](fit.csv) and
[ablate_samples.csv](ablate_samples.csv); `ddf render artifacts/{name}/fit_shape OUT.png` draws more.
"""
_VIEWS: Final = """
The field from four cameras, beside the mesh that it was fitted to, with no post-processing. Below each name: azimuth,
elevation and distance of the camera, which looks at the box's centre (0.57: one diagonal of the box), and the rays that
met the box. Depth: yellow is near, one scale a row. Normals, and n₁, n₂ of both components whichever is heavier:
(n + 1)/2 as RGB; where the lighter component models the surface behind the visible one, it shows there. Mean
curvature (tr II): red is hollow, blue bulges towards the viewer. w₁: red where component 1 gives the depth, blue where
component 2 does.
"""
_SLICES: Final = """
The field on two planes z = const ({levels} of the box), every pixel a start p, one direction v a row as in the paper's
figure 1: visibility ξ, w₁, depth and true depth. White: nothing is seen; outside the box nothing is asked. The depth
jumps where p moves through the surface.
"""
_ERRORS: Final = """
Errors on {held_out} held-out samples of each type. Depth: mean |d - d̂| × 10 over visible samples, in units of half the
box's longest side; visibility: cross-entropy, natural logarithm; normals: angle over visible samples. The rows
"{paper}" are the paper's fit to the Stanford bunny with 500,000 samples and 100,000 steps, of table `dataablation`:
another shape and another budget, not comparable cell by cell.
"""
_DIAGNOSTICS_TEXT: Final = """
How far the field is from being a DDF at all, on random rays of the box: identities of every exact DDF, no truth
needed. Depths in units of half the box's longest side. Derivatives of an exact field grow without bound towards grazing
rays, so the worst values are those of single rays. View consistency: a point q₁ that (p₁, v₁) sees is looked at from
another start, q₁ = p₂ + t v₂, where it, or something before it, must be seen.
"""
_ABLATION: Final = """
{metric} of fits that were trained without one sample type (rows), on held-out samples of each type (columns). Every fit
here has {samples} samples or less by rounding, all types together, and {steps} steps with as many points in each; the
paper's have 500,000 samples and 100,000 steps on the Stanford bunny. Bold: the worst of a column.
"""
_ITSELF: Final = """
{metric}: leaving a type out is worst of all for held-out samples of that type {count} of {whole} times ({types}); in
the paper {paper_count} of {whole} ({paper_types}).
"""
_CURVES: Final = "Total loss (thick, smoothed) and its terms without their weights."
_LIMITS: Final = (
    "One seed, one shape, and not the paper's. `configs/paper_fit.yaml` has the paper's sizes, losses and steps, but "
    "for its plateau schedule; `configs/fit.yaml` a small fraction of them.",
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


def read(config_path: Path, fit: fitting.FitConfig) -> Results:
    """Everything that the page says.

    Raises:
      FileNotFoundError: a stage has not run.
    """
    folder = config.artifact_dir(config_path, "fit_shape")
    ablated = config.artifact_dir(config_path, "ablate_samples")
    return Results(
        name=config_path.stem,
        source=None if fit.mesh is None else Path(fit.mesh).name,
        metrics=storage.read_json(folder / fitting.METRICS),
        log=pd.DataFrame(training_loop.read_log(folder)),
        errors=storage.load_table(folder / fit_errors.FIT)[0],
        diagnostics=storage.read_json(folder / DIAGNOSTICS),
        views=storage.read_json(folder / VIEW_RECORD),
        ablation=storage.read_json(ablated / leave_one_out.RESULTS),
        ablation_errors=storage.load_table(ablated / fit_errors.ABLATION, keep_default_na=False)[0],
    )


def write(config_path: Path, fit: fitting.FitConfig, out_dir: Path) -> None:
    """README.md, index.html, both tables and the pictures."""
    results = read(config_path, fit)
    folder = config.artifact_dir(config_path, "fit_shape")
    page = build(results, fit, {name: (folder / name).read_bytes() for name in (VIEWS, SLICES)})
    for name, content in page.files.items():
        storage.write_bytes(out_dir / name, content)
    for name, table in ((fit_errors.FIT, results.errors), (fit_errors.ABLATION, results.ablation_errors)):
        storage.write_text(out_dir / name, table.to_csv(index=False, lineterminator="\n"))
    storage.write_text(out_dir / "README.md", pages.markdown(page))
    storage.write_text(out_dir / "index.html", pages.html_page(page))


def build(results: Results, fit: fitting.FitConfig, pictures: dict[str, bytes]) -> pages.Page:
    """The page from results already read; `pictures` by file name."""
    files = pictures | {CURVES: figures.loss_curves({"DDF": {"one shape": results.log}}).encode()}
    shape = "a procedural chair" if results.source is None else f"`{results.source}`"
    lead = [pages.paragraph(_LEAD, shape=shape, name=results.name), pages.paragraph(_SOURCE, name=results.name)]
    levels = " and ".join(f"{100 * level:.0f} %" for level in shape_views.SLICE_LEVELS)
    alts = ("renders of the fitted field from four cameras", "slices of the fitted field in three directions")
    blocks = [
        pages.Figure(VIEWS, pages.paragraph(_VIEWS), alts[0]),
        pages.Figure(SLICES, pages.paragraph(_SLICES, levels=levels), alts[1]),
    ]
    held_out = f"{fit.held_out.U:,}"
    caption = pages.paragraph(_ERRORS, held_out=held_out, paper=paper_ablation.SOURCE)
    consistency = shape_tables.diagnostics(results.diagnostics, pages.paragraph(_DIAGNOSTICS_TEXT))
    sections = [
        pages.Section("Pictures", blocks),
        pages.Section("Held-out errors", [shape_tables.errors(results.errors, caption)]),
        pages.Section("Consistency", [consistency]),
        _ablation_section(results),
        _training_section(results),
        pages.Section("What does not reproduce", [_LIMITS]),
    ]
    return pages.Page(f"A field of one shape: {results.name}", lead, sections, files)


def _ablation_section(results: Results) -> pages.Section:
    tables, findings = [], []
    full = results.ablation[leave_one_out.NONE]
    whole = len(TYPES)
    most = max(found["samples"] for found in results.ablation.values())
    for metric, name in shape_tables.METRIC_NAMES.items():
        caption = pages.paragraph(_ABLATION, metric=name, samples=f"{most:,}", steps=f"{full['steps']:,}")
        tables.append(shape_tables.ablation(results.ablation_errors, metric, caption))
        ours, theirs = (
            shape_tables.worst_for_itself(results.ablation_errors, metric, source)
            for source in (MEASURED, paper_ablation.SOURCE)
        )
        words = {"count": len(ours), "types": _listed(ours), "paper_count": len(theirs), "paper_types": _listed(theirs)}
        findings.append(pages.paragraph(_ITSELF, metric=name, whole=whole, **words))
    return pages.Section("Sample types left out", [*tables, tuple(findings)])


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
    table = pages.Table("The fit, and what the renders above cost.", [("", 2, False)], ["", ""], rows)
    return pages.Section("Training", [pages.Figure(CURVES, _CURVES, "loss curve of the fit"), table])

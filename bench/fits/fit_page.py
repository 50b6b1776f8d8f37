"""The page of what fits of single shapes reach, `reports/fit_proof/README.md`; `python -m bench fit_page` writes it.

From the rows of `fit_curves`, `fit_options` and `primitive_fits` and the table of `contact_sheet`; what has not been
made is left out.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import pandas as pd

from bench.fits import contact_sheet, fit_curves, fit_options, primitive_fits
from bench.lib import measuring, results
from bench.lib.results import Benchmark, Row
from ddf.core import checks, storage
from ddf_lab.evaluation.shape import leave_one_out, paper_ablation
from ddf_lab.report import pages
from ddf_lab.report.shape import shape_tables

TITLE = "What fits of single shapes reach"
ORDER = paper_ablation.COLUMNS
_LEAD = (
    "Made by `make fit-proof`.",
    "Depth errors are L1 × 10 in units of half the box's longest side, over visible held-out samples of a type.",
    "Visibility errors are cross-entropies with natural logarithms.",
)


def build(found: dict[str, Benchmark], sheet: pd.DataFrame | None) -> pages.Page:
    """Verdict, picture and sections of what is there.

    Raises:
      InputError: nothing is.
    """
    lead: list[pages.Block] = []
    sections = []
    if fit_curves.NAME in found:
        lead += [verdict(found[fit_curves.NAME]), _curves_picture()]
        sections.append(curves(found[fit_curves.NAME]))
    if fit_options.NAME in found:
        sections.append(options(found[fit_options.NAME]))
    if primitive_fits.NAME in found:
        sections.append(closed_forms(found[primitive_fits.NAME]))
    if sheet is not None:
        sections.append(everyday(sheet))
    if not sections:
        raise checks.InputError("nothing to tell: `make fit-proof` fits")
    return pages.Page(TITLE, [*lead, _LEAD], sections)


def verdict(benchmark: Benchmark) -> str:
    """How many of the paper's errors every way of fitting reaches, after how long, and which are like for like."""
    ends = [row for row in benchmark.rows if row.what.endswith(", end")]
    reached = [f"`{_name(row)}` {_reached(row)} ({_seconds(row.seconds[1])})" for row in ends if row.seconds]
    alike = any(_name(row) == fit_curves.LIKE for row in ends)
    return (
        f"Of the paper's twelve held-out errors, each way of fitting reaches: {', '.join(reached)}."
        " `fit` and `long_fit` have more samples than the paper's row, a margin around the shape and T samples that see"
        f" what they touch; {f'`{fit_curves.LIKE}` has the data of the row.' if alike else 'no way has its data.'}"
    )


def _name(row: Row) -> str:
    return row.what.removesuffix(", end")


def _reached(row: Row) -> int:
    return sum(
        row.error[f"{metric}_{kind}"] <= _paper(metric)[kind] for metric in paper_ablation.METRICS for kind in ORDER
    )


def _paper(metric: str) -> dict[str, float]:
    """The paper's fit with all sample types, by held-out type."""
    return dict(zip(ORDER, paper_ablation.METRICS[metric][leave_one_out.NONE], strict=True))


def _curves_picture() -> pages.Figure:
    return pages.Figure(
        f"../bench/{fit_curves.NAME}.png",
        "Errors on held-out samples against seconds of training. Sampling and evaluations are not counted.",
        "falling curves of held-out errors against seconds, one a way of fitting",
    )


def machine(benchmark: Benchmark) -> str:
    """Where it was measured."""
    versions = f"torch {benchmark.versions['torch']}"
    return f"{benchmark.cpu}, {benchmark.cores} cores, {_threads(benchmark.threads)} each, {versions}."


def _threads(count: int) -> str:
    return f"{count} thread{'s' if count > 1 else ''}"


def curves(benchmark: Benchmark) -> pages.Section:
    """The twelve figures of every way beside the paper's, and how much sooner ours get down to an error."""
    ends = [row for row in benchmark.rows if row.what.endswith(", end")]
    tables = []
    for metric, name in shape_tables.METRIC_NAMES.items():
        paper = _paper(metric)
        rows: list[list[pages.Cell | str]] = []
        for row in ends:
            cells = [_figure(row.error[f"{metric}_{kind}"], paper[kind]) for kind in ORDER]
            rows.append([_name(row), _effort(row), *cells])
        rows.append([paper_ablation.SOURCE, "100,000 steps", *(shape_tables.number(paper[kind]) for kind in ORDER)])
        caption = f"{name}, at the end of each fit. Bold: at most the paper's value."
        groups = [("", 2, False), ("held-out", len(ORDER), False)]
        tables.append(pages.Table(caption, groups, ["", "", *ORDER], rows, labels=2))
    told = tuple(_sentence(row) for row in benchmark.rows if "times" in row.told)
    held_out = f"{ends[0].told['held_out']:,} held-out samples of each type"
    notes = (f"Shape: {ends[0].size['shape']}, {held_out}.", machine(benchmark))
    return pages.Section("The twelve figures", [*([told] if told else []), *tables, notes])


def options(benchmark: Benchmark) -> pages.Section:
    """Every setting of a fit that was changed alone, against the base."""
    base = next(row for row in benchmark.rows if row.what == fit_options.BASE)
    bold = "Bold: at most the base's value."
    tables = []
    for metric, name in shape_tables.METRIC_NAMES.items():
        names = [f"{metric}_{kind}" for kind in ORDER]
        rows = [[row.what, *(_figure(row.error[n], base.error[n]) for n in names)] for row in benchmark.rows]
        groups = [("", 1, False), ("held-out", len(ORDER), False)]
        tables.append(pages.Table(f"{name}. {bold}", groups, ["", *ORDER], rows))
    angle = "normal_angle_deg_median"
    rows = [[row.what, _effort(row), _figure(row.error[angle], base.error[angle])] for row in benchmark.rows]
    caption = f"What was spent, and the median angle of normals. {bold}"
    tables.append(pages.Table(caption, [("", 3, False)], ["", "", "normals, median °"], rows))
    notes = (f"Shape: {base.size['shape']}.", *_about(fit_options), machine(benchmark))
    return pages.Section("What each setting is worth", [*tables, notes])


def _figure(value: float | None, bound: float | None) -> pages.Cell:
    """None: a mean over nothing."""
    better = value is not None and bound is not None and value <= bound
    return pages.Cell(shape_tables.number(value), best=better)


def _effort(row: Row) -> str:
    seconds = f"{row.seconds[1]:,.0f} s, " if row.seconds else ""
    return f"{seconds}{row.told['steps']:,} steps"


def _sentence(row: Row) -> str:
    """How much sooner one of ours gets to an A-type depth error than the paper's recipe; nothing is extrapolated."""
    name, told = row.what.partition(",")[0], row.told
    words = (
        f"`{name}` is at {told['level']:.3g} (A, L1 × 10) after {_seconds(told['our_seconds'])}, "
        f"`{fit_curves.PAPER}` after {_seconds(told['their_seconds'])}: {told['times']:.3g} times as long."
    )
    level = f"the {told['goal']:.3g} that `{name}` is at after {_seconds(told['goal_seconds'])}"
    if told["bound"]:
        return f"{words} In all its {_seconds(told['their_goal_seconds'])} it does not come down to {level}."
    return f"{words} It comes down to {level} after {_seconds(told['their_goal_seconds'])}."


def _about(script: ModuleType) -> list[str]:
    """The sentences of its docstring below the first line."""
    text = " ".join((script.__doc__ or "").partition("\n\n")[2].split())
    return re.split(r"(?<=\.) (?=[A-Z])", text)


def _seconds(value: float) -> str:
    return f"{value:,.0f} s" if value >= 100 else f"{value:.3g} s"


def closed_forms(benchmark: Benchmark) -> pages.Section:
    """Sphere, box and torus: what was fitted, then curvatures."""
    names = list(dict.fromkeys(name for row in benchmark.rows for name in row.error))
    curvatures = [name for name in names if "curvature" in name]
    others = [name for name in names if name not in curvatures]
    rows: list[Sequence[pages.Cell | str]] = [[row.what, _effort(row), *_errors(row, others)] for row in benchmark.rows]
    header = ["", "", *(name.replace("_", " ") for name in others)]
    first = pages.Table(
        "Normals in degrees, depth, share of wrong visibility.", [("", len(header), False)], header, rows
    )
    curved = [row for row in benchmark.rows if any(name in row.error for name in curvatures)]
    rows = [[row.what, *_errors(row, curvatures)] for row in curved]
    header = ["", *(name.replace("_", " ") for name in curvatures)]
    second = pages.Table("Relative errors of curvatures.", [("", len(header), False)], header, rows)
    budget = f"Budget: {benchmark.rows[0].size['minutes']:g} minutes each."
    tables = [first, second] if curved else [first]
    return pages.Section("Against closed forms", [*tables, (*_about(primitive_fits), budget, machine(benchmark))])


def _errors(row: Row, names: Sequence[str]) -> list[str]:
    return [f"{row.error[name]:.3g}" if name in row.error else "–" for name in names]


def everyday(table: pd.DataFrame) -> pages.Section:
    """The contact sheet and medians of its table."""
    columns = [f"{metric}_{kind}" for metric in paper_ablation.METRICS for kind in ORDER]
    middle = table[columns].median()
    rows: list[list[pages.Cell | str]] = [
        [name, *(shape_tables.number(float(middle[f"{metric}_{kind}"])) for kind in ORDER)]
        for metric, name in shape_tables.METRIC_NAMES.items()
    ]
    caption = (
        f"Medians over {len(table)} meshes, {table['seconds'].median():.0f} s and {_threads(table['threads'].max())} "
        f"each (sampling and training); each mesh: [{contact_sheet.TABLE}]({contact_sheet.TABLE})."
    )
    alt = "each mesh from two cameras: depth and normals of the field beside those of the mesh"
    words = "Field and mesh from two cameras. White: nothing is seen."
    return pages.Section(
        "Everyday meshes",
        [
            pages.Figure(contact_sheet.SHEET, words, alt),
            pages.Table(caption, [("", 1, False), ("held-out", 6, False)], ["", *ORDER], rows),
        ],
    )


def load_sheet(folder: Path) -> pd.DataFrame | None:
    """The table of the contact sheet, if it has been made."""
    file = folder / contact_sheet.TABLE
    return pd.read_csv(file) if file.exists() else None


def run(_: Sequence[str]) -> int:
    """Write the page."""
    names = (fit_curves.NAME, fit_options.NAME, primitive_fits.NAME)
    files = [measuring.OUT / f"{name}.json" for name in names]
    found: dict[str, Any] = {file.stem: results.load(file) for file in files if file.exists()}
    page = build(found, load_sheet(contact_sheet.OUT))
    storage.write_text(contact_sheet.OUT / "README.md", pages.markdown(page))
    print(contact_sheet.OUT / "README.md")
    return 0

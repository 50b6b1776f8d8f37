"""The page of what fits of single shapes reach, `reports/fit_proof/README.md`; `python -m bench fit_page` writes it.

From the rows of `fit_curves`, `fit_options` and `primitive_fits` and the table of `contact_sheet`; what has not been
made is left out.
"""

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import pandas as pd

from bench.fits import contact_sheet, fit_curves, fit_options, primitive_fits
from bench.lib import measuring, results
from bench.lib.results import Benchmark, Row
from ddf.core import checks, storage
from ddf.report import pages
from ddf.report.shape import shape_tables
from ddf.shape import leave_one_out, paper_ablation

TITLE = "What fits of single shapes reach"
ORDER = paper_ablation.COLUMNS
_LEAD = (
    "Made by `make fit-proof`. Depth errors are L1 × 10 in units of half the box's longest side, over visible held-out "
    "samples of a type; visibility errors are cross-entropies with natural logarithms."
)


def build(found: dict[str, Benchmark], sheet: pd.DataFrame | None) -> pages.Page:
    """Sections of what is there.

    Raises:
      InputError: nothing is.
    """
    sections = []
    if fit_curves.NAME in found:
        sections += curves(found[fit_curves.NAME])
    if fit_options.NAME in found:
        sections.append(options(found[fit_options.NAME]))
    if primitive_fits.NAME in found:
        sections.append(closed_forms(found[primitive_fits.NAME]))
    if sheet is not None:
        sections.append(everyday(sheet))
    if not sections:
        raise checks.InputError("nothing to tell: `make fit-proof` fits")
    return pages.Page(TITLE, [_LEAD], sections)


def machine(benchmark: Benchmark) -> str:
    """Where it was measured."""
    versions = f"torch {benchmark.versions['torch']}"
    return f"{benchmark.cpu}, {benchmark.cores} cores, {_threads(benchmark.threads)} each, {versions}."


def _threads(count: int) -> str:
    return f"{count} thread{'s' if count > 1 else ''}"


def curves(benchmark: Benchmark) -> list[pages.Section]:
    """The twelve figures of every way beside the paper's, and how much sooner ours get down to an error."""
    ends = [row for row in benchmark.rows if row.what.endswith(", end")]
    shape = str(ends[0].size["shape"])
    rows: list[list[pages.Cell | str]] = []
    for metric, name in shape_tables.METRIC_NAMES.items():
        paper = dict(zip(paper_ablation.COLUMNS, paper_ablation.METRICS[metric][leave_one_out.NONE], strict=True))
        for row in ends:
            cells = [_figure(row.error[f"{metric}_{kind}"], paper[kind]) for kind in ORDER]
            rows.append([name, row.what.removesuffix(", end"), *_effort(row), *cells])
        values = [shape_tables.number(paper[kind]) for kind in ORDER]
        rows.append([name, paper_ablation.SOURCE, "–", "100,000", *values])
    caption = (
        f"{shape}, {ends[0].told['held_out']:,} held-out samples of each type, at the end of each fit. Bold: at most "
        f"the paper's value. {machine(benchmark)}"
    )
    table = pages.Table(caption, [("", 4, False), ("held-out", 6, False)], ["", "", "s", "steps", *ORDER], rows, 2)
    picture = pages.Figure(
        f"../bench/{fit_curves.NAME}.png",
        "Errors on held-out samples against seconds of training, sampling and evaluations not counted.",
        "curves of held-out errors against seconds",
    )
    told = tuple(_sentence(row) for row in benchmark.rows if "times" in row.told)
    return [
        pages.Section("The twelve figures", [table]),
        pages.Section("Error against time", [picture, *([told] if told else [])]),
    ]


def options(benchmark: Benchmark) -> pages.Section:
    """Every setting of a fit that was changed alone, against the base."""
    base = next(row for row in benchmark.rows if row.what == fit_options.BASE)
    names = [f"{metric}_{kind}" for metric in paper_ablation.METRICS for kind in ORDER] + ["normal_angle_deg_median"]
    rows: list[list[pages.Cell | str]] = [
        [row.what, *_effort(row), *(_figure(row.error[name], base.error[name]) for name in names)]
        for row in benchmark.rows
    ]
    caption = f"{base.size['shape']}. {_about(fit_options)} Bold: at most the base's value. {machine(benchmark)}"
    metrics = [(name, len(ORDER), False) for name in shape_tables.METRIC_NAMES.values()]
    groups = [("", 3, False), *metrics, ("", 1, False)]
    header = ["", "s", "steps", *ORDER, *ORDER, "normals, median °"]
    return pages.Section("What each setting is worth", [pages.Table(caption, groups, header, rows, 1)])


def _figure(value: float, bound: float) -> pages.Cell:
    return pages.Cell(shape_tables.number(value), best=value <= bound)


def _effort(row: Row) -> list[str]:
    return [f"{row.seconds[1]:,.0f}" if row.seconds else "–", f"{row.told['steps']:,}"]


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


def _about(script: ModuleType) -> str:
    """What its docstring says below the first line."""
    return " ".join((script.__doc__ or "").partition("\n\n")[2].split())


def _seconds(value: float) -> str:
    return f"{value:,.0f} s" if value >= 100 else f"{value:.3g} s"


def closed_forms(benchmark: Benchmark) -> pages.Section:
    """Sphere, box and torus."""
    names = list(dict.fromkeys(name for row in benchmark.rows for name in row.error))
    rows: list[Sequence[pages.Cell | str]] = [
        [row.what, *_effort(row), *(f"{row.error[name]:.3g}" if name in row.error else "–" for name in names)]
        for row in benchmark.rows
    ]
    header = ["", "s", "steps", *(name.replace("_", " ") for name in names)]
    minutes = benchmark.rows[0].size["minutes"]
    caption = f"{_about(primitive_fits)} Budget: {minutes:g} minutes each. {machine(benchmark)}"
    return pages.Section("Against closed forms", [pages.Table(caption, [("", len(header), False)], header, rows)])


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
    words = f"{alt.capitalize()}. White: nothing is seen."
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

"""The page of the benchmarks, `reports/bench/README.md`, from their JSON files: `python -m bench page` writes it.

A section has the first paragraph of the benchmark's docstring, its picture (`PICTURE` of the module) and the lines that
a reader compares: those that end as `LINES` of the module says, those on a frontier, or the first ones. The JSON file
has all.
"""

import importlib
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from matplotlib import figure, ticker  # noqa: TID251  (the package's own charts belong to its report)

from bench.lib import catalogue, measuring
from ddf.core import checks
from ddf_lab.report import pages

LEAD = 'Made by `make bench`; `make bench BENCH="evaluation ray_casting"` makes some. Times are medians.'
MOST_ROWS, MOST_ERRORS = 20, 4  # of a table
POINT, FRONTIER, EXACT, INK = "#7FA7D6", "#1F5FA8", "#9AA1AD", "#3A404A"
COLUMNS, SIDE = 3, 4.3  # panels side by side; inches of a panel
ALIKE = 2.0  # a panel whose errors differ by less has nothing to choose


@dataclass(frozen=True)
class View:
    """Panels of a benchmark's picture: time against an error.

    error: key of the error drawn. label: its axis. panels: keys of `size` that rows of one panel share. keep: rows that
    can be compared at all.
    """

    error: str
    label: str
    panels: tuple[str, ...] = ()
    keep: Callable[["Row"], bool] = lambda _: True


@dataclass(frozen=True)
class Row:
    """One line. seconds: the median, None where only the error was measured. told: everything else."""

    what: str
    size: dict[str, Any]
    seconds: float | None
    error: dict[str, float]
    told: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Benchmark:
    """A file of rows. machine: where and in how many seconds they were measured, as printed."""

    name: str
    machine: str
    rows: list[Row]


def load(file: Path) -> Benchmark:
    """The rows of one file.

    Raises:
      InputError: it is not such a file, or a row lacks something; named.
    """
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        rows = [_row(entry) for entry in record["rows"]]
        versions = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
        machine = f"{record['cpu']}, {record['cores']} cores, threads: {record['threads']}; {versions}"
        return Benchmark(record["benchmark"], f"{machine}; {record['took_s']:.0f} s in all.", rows)
    except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
        raise checks.InputError(f"{file}: not the result of a benchmark ({type(error).__name__}: {error})") from error


def _row(entry: dict[str, Any]) -> Row:
    seconds = entry.get("median_s")
    if seconds is not None and not 0 < entry["quartiles_s"][0] <= seconds <= entry["quartiles_s"][1] < math.inf:
        raise ValueError(f"seconds must be positive and in order in {entry['what']}")
    own = ("what", "size", "median_s", "quartiles_s", "samples", "error")
    told = {name: value for name, value in entry.items() if name not in own}
    return Row(entry["what"], dict(entry["size"]), seconds, dict(entry["error"]), told)


def load_folder(folder: Path) -> dict[str, Benchmark]:
    """All benchmarks of a folder by name.

    Raises:
      InputError: there is none.
    """
    found = {file.stem: load(file) for file in sorted(folder.glob("*.json"))}
    if not found:
        raise checks.InputError(f"{folder}: holds no results; `make bench` writes them")
    return found


def frontier(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other is at least as good as in both coordinates (small is good), by the first."""
    found: list[int] = []
    for index in sorted(range(len(points)), key=lambda i: (*points[i], i)):
        if not found or points[index][1] < points[found[-1]][1]:
            found.append(index)
    return found


def panels(benchmark: Benchmark, view: View) -> dict[str, list[int]]:
    """Rows that can be drawn, by title of their panel; a panel whose errors are alike is left out."""
    groups: dict[str, list[int]] = {}
    for index, row in enumerate(benchmark.rows):
        if row.seconds and row.error.get(view.error, -1) >= 0 and view.keep(row):
            name = ", ".join(f"{measuring.title(key)} {measuring.text(row.size.get(key))}" for key in view.panels)
            groups.setdefault(name, []).append(index)
    errors = {name: [benchmark.rows[i].error[view.error] for i in rows] for name, rows in groups.items()}
    return {name: rows for name, rows in groups.items() if max(errors[name]) > ALIKE * min(errors[name])}


def best(benchmark: Benchmark, view: View, rows: Sequence[int]) -> list[int]:
    """Those of the rows that are on the frontier."""
    found = [benchmark.rows[index] for index in rows]
    return [rows[i] for i in frontier([(row.seconds or math.inf, row.error[view.error]) for row in found])]


def draw(benchmark: Benchmark, views: Sequence[View]) -> bytes | None:
    """A PNG of all panels, None without any; an error of exactly 0 stands on a line of its own below all others."""
    drawn = [(view, name, rows) for view in views for name, rows in panels(benchmark, view).items()]
    if not drawn:
        return None
    columns, lines = min(len(drawn), COLUMNS), math.ceil(len(drawn) / COLUMNS)
    chart = figure.Figure(figsize=(SIDE * columns, SIDE * lines), dpi=120, layout="constrained")
    grid = chart.subplots(lines, columns, squeeze=False).flatten()
    for axes in grid[len(drawn) :]:
        axes.set_visible(False)
    for axes, (view, name, rows) in zip(grid, drawn, strict=False):
        _draw(axes, benchmark, view, name, rows)
    buffer = io.BytesIO()
    chart.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _draw(axes, benchmark: Benchmark, view: View, name: str, rows: Sequence[int]) -> None:  # matplotlib's Axes
    found = {
        index: (1e3 * (benchmark.rows[index].seconds or 0), benchmark.rows[index].error[view.error]) for index in rows
    }
    positive = [error for _, error in found.values() if error > 0]
    floor = min(positive) / 4 if positive else 1.0
    places = {index: (ms, error or floor) for index, (ms, error) in found.items()}
    if len(positive) < len(places):
        axes.axhline(floor, color=EXACT, lw=0.8, ls=(0, (4, 3)), zorder=0)
        axes.text(
            1, floor, "exact", transform=axes.get_yaxis_transform(), ha="right", va="top", fontsize=7.5, color=EXACT
        )
    chosen = best(benchmark, view, rows)
    axes.step(*zip(*(places[i] for i in chosen), strict=True), where="post", color=FRONTIER, lw=1.1, zorder=1)
    axes.scatter(*zip(*places.values(), strict=True), s=14, color=POINT, zorder=2)
    axes.scatter(*zip(*(places[i] for i in chosen), strict=True), s=22, color=FRONTIER, zorder=3)
    for i in chosen:
        axes.annotate(benchmark.rows[i].what[:40], places[i], (4, 3), textcoords="offset points", fontsize=7, color=INK)
    axes.set_title(name, loc="left", fontsize=9.5, fontweight="bold")
    axes.set_ylabel(view.label, fontsize=8.5)
    axes.set_xlabel("ms", fontsize=8.5, loc="right")
    axes.set(xscale="log", yscale="log")
    axes.margins(x=0.12, y=0.12)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        axis.set_minor_formatter(ticker.NullFormatter())
    axes.tick_params(labelsize=7.5)
    axes.grid(color="#E6E9EE", lw=0.7)
    axes.spines[["top", "right"]].set_visible(False)


def table(benchmark: Benchmark, views: Sequence[View], names: Sequence[str] = ()) -> pages.Table:
    """Speed beside error, a line per row; what is the same in all rows goes into the caption.

    Args:
      names: how the rows end that are shown; none: those of the frontiers.
    """
    rows = [row for row in benchmark.rows if row.what.endswith(tuple(names))] if names else benchmark.rows
    if len(rows) > MOST_ROWS and not names:
        chosen = [i for view in views for own in panels(benchmark, view).values() for i in best(benchmark, view, own)]
        rows = [rows[i] for i in sorted(dict.fromkeys(chosen or range(len(rows))))[:MOST_ROWS]]
    sizes = [name for name in rows[0].size if any(row.size.get(name) != rows[0].size[name] for row in rows)]
    errors = list(dict.fromkeys(name for row in rows for name in row.error))[:MOST_ERRORS]
    lines = []
    for row in rows:
        values = [measuring.text(row.size.get(name)) for name in sizes]
        values.append(measuring.number(1e3 * row.seconds) if row.seconds else "–")
        lines.append([row.what, *values, *(measuring.number(row.error[n]) if n in row.error else "–" for n in errors)])
    header = ["", *map(measuring.title, sizes), "ms", *map(measuring.title, errors)]
    caption = "; ".join(
        f"{measuring.title(name)} {measuring.text(value)}" for name, value in rows[0].size.items() if name not in sizes
    )
    shown = f"{len(rows)} of {len(benchmark.rows)} lines; all: [{benchmark.name}.json]({benchmark.name}.json)."
    return pages.Table(f"{caption}. {shown}" if caption else shown, header, lines)


def page(found: Mapping[str, Benchmark]) -> pages.Page:
    """Every benchmark by name."""
    sections = []
    for entry in catalogue.chosen(list(found)):
        benchmark, module = found[entry.name], importlib.import_module(entry.module)
        views, names = getattr(module, "PICTURE", ()), getattr(module, "LINES", ())
        blocks: list[Any] = [entry.about, benchmark.machine]
        if picture := draw(benchmark, views):
            alt = (
                f"{measuring.title(entry.name)}: time against {', '.join(dict.fromkeys(view.label for view in views))}"
            )
            blocks.append(
                pages.Figure(f"{entry.name}.png", "Left and below is better; the line is the frontier.", alt, picture)
            )
        sections.append(
            pages.Section(measuring.title(entry.name).capitalize(), [*blocks, table(benchmark, views, names)])
        )
    return pages.Page("Speed against error", [LEAD], sections)


def run() -> int:
    """Write the page and its pictures beside the results."""
    made = page(load_folder(measuring.OUT))
    for name, data in made.contents().items():
        (measuring.OUT / name).write_bytes(data)
    (measuring.OUT / "README.md").write_text(pages.markdown(made), encoding="utf-8")
    print(measuring.OUT / "README.md")
    return 0

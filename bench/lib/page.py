"""The page of the benchmarks, `reports/bench/README.md`, from their JSON files: `python -m bench page` writes it.

What a benchmark is, is the first paragraph of its docstring; what its section shows, its `SECTION` (`lib.display`).
"""

import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from bench.lib import catalogue, measuring, pareto, results
from bench.lib.display import Section, View, number, text, title
from bench.lib.results import Benchmark, Row
from ddf_lab.report import pages

LEAD = 'Made by `make bench`; `make bench BENCH="evaluation ray_casting"` makes some. Times are medians and quartiles.'


def headings(rows: Sequence[Row], part: Callable[[Row], Mapping[str, Any]]) -> list[str]:
    """Names in that part of the rows whose value is not the same in all of them."""
    names = dict.fromkeys(name for row in rows for name in part(row))
    return [name for name in names if any(part(row).get(name) != part(rows[0]).get(name) for row in rows)]


def table(benchmark: Benchmark) -> pages.Table:
    """Speed beside error, a line per row; what is the same in all rows goes into the caption."""
    rows = benchmark.rows
    sizes, told = headings(rows, lambda row: row.size), headings(rows, lambda row: row.told)
    errors = list(dict.fromkeys(name for row in rows for name in row.error))
    lines = []
    for place, row in enumerate(rows, start=1):
        low, middle, high = (number(1e3 * seconds) for seconds in row.seconds) if row.seconds else ("", "–", "")
        values = [text(row.size.get(name)) for name in sizes]
        values += [middle, f"{low} – {high}"] + [number(row.error[n]) if n in row.error else "–" for n in errors]
        lines.append([str(place), row.what, *values, *(text(row.told.get(name)) for name in told)])
    header = ["#", "", *map(title, sizes), "ms", "q1 – q3", *map(title, errors), *map(title, told)]
    same = {name: value for name, value in rows[0].size.items() if name not in sizes} if rows else {}
    caption = "; ".join(f"{title(name)} {text(value)}" for name, value in same.items())
    return pages.Table(caption or "All settings are in the table.", [("", len(header), False)], header, lines, labels=2)


def panels(benchmark: Benchmark, shown: View) -> list[pareto.Panel]:
    """Rows that can be drawn, by panel; one whose errors are alike has nothing to choose from and is left out."""
    groups: dict[str, list[pareto.Point]] = {}
    for place, row in enumerate(benchmark.rows, start=1):
        error = row.error.get(shown.error)
        if row.seconds and error is not None and error >= 0 and shown.keep(row):
            groups.setdefault(shown.title(row), []).append(pareto.Point(place, row.what, row.seconds[1], error))
    return [pareto.Panel(name, shown.label, points) for name, points in groups.items() if _differ(points)]


def _differ(points: Sequence[pareto.Point]) -> bool:
    errors = [point.error for point in points]
    return max(errors) > pareto.ALIKE * min(errors)


def section(benchmark: Benchmark, about: str, shown: Section) -> pages.Section:
    """Sentence, machine, picture, table."""
    versions = ", ".join(f"{name} {version}" for name, version in benchmark.versions.items())
    blocks: list[Any] = [
        about,
        f"{benchmark.cpu}, {benchmark.cores} cores, threads: {benchmark.threads}; {versions}; "
        f"{benchmark.took_s:.0f} s in all.",
        *filter(None, [shown.note(benchmark)]),
    ]
    if drawn := [panel for view in shown.views for panel in panels(benchmark, view)]:
        caption = "Left and below is better. Numbers are those of the table's lines; the line is the frontier."
        alt = f"{title(benchmark.name)}: time against {', '.join(dict.fromkeys(panel.error for panel in drawn))}"
        blocks.append(pages.Figure(f"{benchmark.name}.png", caption, alt, pareto.draw(drawn)))
    return pages.Section(title(benchmark.name).capitalize(), [*blocks, *pages.split(table(benchmark))])


def page(found: Mapping[str, Benchmark]) -> pages.Page:
    """Every benchmark by name."""
    sections = []
    for entry in catalogue.chosen(list(found)):
        shown = getattr(importlib.import_module(entry.module), "SECTION", Section())
        sections.append(section(found[entry.name], entry.about, shown))
    return pages.Page("Speed against error", [LEAD], sections)


def run() -> int:
    """Write the page and its pictures beside the results."""
    made = page(results.load_folder(measuring.OUT))
    for name, data in made.contents().items():
        (measuring.OUT / name).write_bytes(data)
    (measuring.OUT / "README.md").write_text(pages.markdown(made), encoding="utf-8")
    print(measuring.OUT / "README.md")
    return 0

"""The page of the benchmarks, `reports/bench/README.md`, from their JSON files: `python -m bench page` writes it.

What a benchmark is, is the first paragraph of its docstring; what its section shows, its `SECTION` (`lib.display`). A
benchmark without a file is left out.
"""

import importlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from bench.lib import catalogue, measuring, pareto, results
from bench.lib.display import Section, View, number, text, title
from bench.lib.results import Benchmark, Row
from ddf_lab.report import pages

TITLE = "Speed against error"


def section_of(name: str) -> Section:
    """What the module of a benchmark says of its section.

    Raises:
      InputError: there is no such benchmark.
    """
    return getattr(importlib.import_module(catalogue.find(name).module), "SECTION", Section())


def views(benchmark: Benchmark) -> tuple[View, ...]:
    """Of a benchmark: its own, or its first error that is positive somewhere; none where there is none."""
    own = section_of(benchmark.name).views
    if own is not None:
        return own
    names = dict.fromkeys(name for row in benchmark.rows for name in row.error)
    found = next((name for name in names if any(row.error.get(name, 0.0) > 0 for row in benchmark.rows)), None)
    return () if found is None else (View(found, title(found)),)


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
        times = ["–"] * 3
        if row.seconds:
            low, middle, high = (number(1e3 * seconds) for seconds in row.seconds)
            times = [middle, f"{low} – {high}", f"{results.spread(row):.2f}"]
        values = [text(row.size.get(name)) for name in sizes]
        values += times + [number(row.error[name]) if name in row.error else "–" for name in errors]
        lines.append([str(place), row.what, *values, *(text(row.told.get(name)) for name in told)])
    header = ["#", "", *map(title, sizes), "ms", "q1 – q3", "spread ×", *map(title, errors), *map(title, told)]
    same = {name: value for name, value in rows[0].size.items() if name not in sizes} if rows else {}
    caption = "; ".join(f"{title(name)} {text(value)}" for name, value in same.items())
    return pages.Table(caption or "All settings are in the table.", [("", len(header), False)], header, lines, labels=2)


def panels(benchmark: Benchmark, shown: View) -> list[pareto.Panel]:
    """Rows that can be drawn, by panel; a panel of one point has nothing to compare and is left out."""
    groups: dict[str, list[tuple[int, Row, float]]] = {}
    for place, row in enumerate(benchmark.rows, start=1):
        value = shown.value(row)
        if row.seconds and value is not None and value >= 0 and shown.keep(row):
            groups.setdefault(shown.title(row), []).append((place, row, value))
    found = []
    for heading, members in groups.items():
        told_apart = len({row.what for _, row, _ in members}) == len(members)
        names = [] if told_apart else headings([row for _, row, _ in members], lambda row: row.size)
        points = [
            pareto.Point(place, _name(row, names, shown), shown.cost(row), value) for place, row, value in members
        ]
        if len(points) > 1 and any(point.error > 0 for point in points):
            found.append(pareto.Panel(heading, shown.label, shown.cost_label, points))
    return found


def _name(row: Row, names: Sequence[str], shown: View) -> str:
    """Of a point: what it is, and the settings that differ within its panel."""
    settings = ", ".join(f"{title(name)} {text(row.size.get(name))}" for name in names if row.size.get(name))
    by_what = not callable(shown.panels) and "what" in shown.panels
    return settings if by_what and settings else ", ".join(filter(None, (row.what, settings)))


def section(benchmark: Benchmark, files: dict[str, bytes], pictures: Sequence[str]) -> pages.Section:
    """Sentence, machine, picture, table; the picture is added to `files`. pictures: drawn by the benchmark itself."""
    versions = ", ".join(f"{name} {version}" for name, version in benchmark.versions.items())
    threads = f"{benchmark.threads} thread{'s' if benchmark.threads > 1 else ''}"
    took = "" if benchmark.took_s is None else f"; {benchmark.took_s:.0f} s in all"
    blocks: list[Any] = [
        catalogue.find(benchmark.name).about,
        f"{benchmark.cpu}, {benchmark.cores} cores, {threads}; {versions}{took}.",
    ]
    if note := section_of(benchmark.name).note(benchmark):
        blocks.append(note)
    drawn = [panel for shown in views(benchmark) for panel in panels(benchmark, shown)]
    if drawn:
        name = f"{benchmark.name}_pareto.png"
        files[name] = pareto.draw(drawn)
        caption = "Left and below is better. Numbers are those of the table's lines; the line is the frontier."
        axes = "; ".join(dict.fromkeys(f"{panel.cost} against {panel.error}" for panel in drawn))
        blocks.append(pages.Figure(name, caption, f"{title(benchmark.name)}: {axes}"))
    if f"{benchmark.name}.png" in pictures:
        caption = "How the time grows with the size of the task."
        blocks.append(pages.Figure(f"{benchmark.name}.png", caption, f"{title(benchmark.name)}: growth"))
    return pages.Section(title(benchmark.name).capitalize(), [*blocks, *pages.split(table(benchmark))])


_LEAD = (
    'Made by `make bench`; `make bench BENCH="evaluation rendering"` runs some.',
    "Times are medians.",
    "`spread`: a second run on the same machine has its medians within this factor, but for one in a hundred.",
    "What all rows of a benchmark share, a slower machine, is taken off first.",
    "It follows from quartiles and number of samples, and from what differs from run to run (`bench/lib/results.py`).",
    "`make bench-check` tries it.",
)


def page(found: Mapping[str, Benchmark], pictures: Sequence[str] = ()) -> pages.Page:
    """The trade-offs that matter most, then every benchmark by name.

    Args:
      pictures: names of files that benchmarks drew themselves.
    """
    files: dict[str, bytes] = {}
    own = {name: section_of(name) for name in found}
    sentences = {name: sentence for name in found if (sentence := own[name].headline(found[name]))}
    ordered = [*sentences, *(name for name in found if name not in sentences)]
    sections = [section(found[name], files, pictures) for name in ordered if not own[name].elsewhere]
    figures = [block for part in sections[: len(sentences)] for block in part.blocks if _is_pareto(block)]
    lead = [_LEAD, *_elsewhere(own)]
    first = [pages.Section("What matters most", [*figures, tuple(sentences.values())])] if sentences else []
    shown = {block.name for block in figures if isinstance(block, pages.Figure)}
    kept = [pages.Section(s.title, [b for b in s.blocks if getattr(b, "name", None) not in shown]) for s in sections]
    return pages.Page(TITLE, lead, [*first, *kept], files)


def _elsewhere(own: Mapping[str, Section]) -> list[str]:
    """A line with the pages of benchmarks that have one of their own, or none."""
    names: dict[str, list[str]] = {}
    for name, part in own.items():
        if part.elsewhere:
            names.setdefault(part.elsewhere, []).append(title(name))
    links = [f"[{', '.join(members)}]({link})" for link, members in names.items()]
    return [f"On pages of their own: {'; '.join(links)}."] if links else []


def _is_pareto(block: Any) -> bool:
    return isinstance(block, pages.Figure) and block.name.endswith("_pareto.png")


def run(_: Sequence[str]) -> int:
    """Write the page and its pictures beside the results."""
    made = page(results.load_folder(measuring.OUT), [file.name for file in measuring.OUT.glob("*.png")])
    for name, data in made.files.items():
        (measuring.OUT / name).write_bytes(data)
    (measuring.OUT / "README.md").write_text(pages.markdown(made), encoding="utf-8")
    print(measuring.OUT / "README.md")
    return 0

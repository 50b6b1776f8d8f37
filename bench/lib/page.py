"""The page of the benchmarks, `reports/bench/README.md`, from their JSON files: `python -m bench page` writes it.

A section has the benchmark's docstring, how many lines are of older code, and the lines that a reader compares: those
that end as `LINES` of the module says, or the first ones. The JSON file has all.
"""

import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.lib import catalogue, measuring
from ddf.core import checks, storage
from ddf_lab.engine import publish
from ddf_lab.report import pages

LEAD = 'Made by such as `make bench BENCH="ray_casting pose"`. Times are medians.'
MOST_ROWS, MOST_ERRORS = 20, 4  # of a table


def number(value: float) -> str:
    """Three digits."""
    return f"{value:.3g}" if abs(value) < 1000 or value != value else f"{value:,.0f}"


def text(value: Any) -> str:
    """A value of `size` as printed."""
    if value is None:
        return "–"
    return number(value) if isinstance(value, float) else f"{value:,}" if isinstance(value, int) else str(value)


def title(name: str) -> str:
    """A key as words."""
    return name.replace("_", " ")


def table(record: Mapping[str, Any], names: Sequence[str] = ()) -> pages.Table:
    """Speed beside error, a line per row; what is the same in all rows goes into the caption.

    Args:
      names: how the rows end that are shown; none: the first ones.
    """
    rows = [row for row in record["rows"] if row["what"].endswith(tuple(names) or "")]
    rows = rows if names else rows[:MOST_ROWS]
    sizes = [name for name in rows[0]["size"] if any(row["size"].get(name) != rows[0]["size"][name] for row in rows)]
    room = min(MOST_ERRORS, pages.MAX_COLUMNS - 2 - len(sizes))
    errors = list(dict.fromkeys(name for row in rows for name in row["error"]))[:room]
    lines = []
    for row in rows:
        off = [number(row["error"][name]) if name in row["error"] else "–" for name in errors]
        lines.append(
            [row["what"], *(text(row["size"].get(name)) for name in sizes), number(1e3 * row["median_s"]), *off]
        )
    same = "; ".join(f"{title(name)} {text(value)}" for name, value in rows[0]["size"].items() if name not in sizes)
    name = record["benchmark"]
    shown = f"{len(rows)} of {len(record['rows'])} lines; all: [{name}.json]({name}.json)."
    header = ["", *map(title, sizes), "ms", *map(title, errors)]
    return pages.Table(f"{same}. {shown}" if same else shown, header, lines)


def page(folder: Path) -> pages.Page:
    """Of every benchmark that has a file there; InputError where none has."""
    found = {file.stem: storage.read_json(file) for file in sorted(folder.glob("*.json"))}
    if not found:
        raise checks.InputError(f"{folder}: holds no results; `python -m bench` lists what makes some")
    sections = []
    for entry in catalogue.chosen(list(found)):
        record, names = found[entry.name], getattr(importlib.import_module(entry.module), "LINES", ())
        versions = ", ".join(f"{name} {version}" for name, version in record["versions"].items())
        machine = f"{record['cpu']}, {record['cores']} cores, threads: {record['threads']}; {versions}"
        codes, own = [row.get("code") for row in record["rows"]], publish.of_bench(entry.file)
        took = f"{machine}; {record['took_s']:.0f} s in all."
        old = len(codes) - codes.count(own)
        took += f" Stale, of older code: {old} of {len(codes)} lines." if old else ""
        blocks = [*entry.about, took, table(record, names)]
        sections.append(pages.Section(title(entry.name).capitalize(), blocks))
    return pages.Page("Speed against error", [LEAD], sections)


def run() -> int:
    """Write the page beside the results."""
    pages.write(page(measuring.OUT), measuring.OUT)
    print(measuring.OUT / "README.md")
    return 0

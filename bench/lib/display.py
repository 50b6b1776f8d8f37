"""What a benchmark's section of the page shows, beside its table: `SECTION` of the benchmark's module, and its words.

Imports nothing heavy: benchmarks that measure memory import this.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bench.lib.results import Benchmark, Row


@dataclass(frozen=True)
class View:
    """Panels of a benchmark's picture: time against an error.

    error: key of the error drawn. label: its axis. panels: keys of `size` that rows of one panel share. keep: rows that
    can be compared at all.
    """

    error: str
    label: str
    panels: tuple[str, ...] = ()
    keep: Callable[[Row], bool] = lambda _: True

    def title(self, row: Row) -> str:
        """Of the panel that a row belongs to."""
        return ", ".join(f"{title(name)} {text(row.size.get(name))}" for name in self.panels)


@dataclass(frozen=True)
class Section:
    """What a section shows: pictures, and a sentence on what the rows say, None where they say nothing of the kind."""

    views: tuple[View, ...] = ()
    note: Callable[[Benchmark], str | None] = lambda _: None


def number(value: float) -> str:
    """Three digits."""
    return f"{value:.3g}" if abs(value) < 1000 or value != value else f"{value:,.0f}"


def text(value: Any) -> str:
    """A value of `size`, or beside it, as printed."""
    if isinstance(value, bool) or value is None:
        return "yes" if value else "–"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, float):
        return number(value)
    return ", ".join(map(text, value)) or "–" if isinstance(value, list) else str(value)


def title(name: str) -> str:
    """A key as words."""
    return name.replace("_", " ")


def milliseconds(row: Row) -> str:
    """The median."""
    return number(1e3 * row.seconds[1]) if row.seconds else "–"


def fastest(rows: Sequence[Row]) -> Row:
    """Of those that were timed."""
    return min(rows, key=lambda row: row.seconds[1] if row.seconds else float("inf"))


def times(row: Row, other: Row) -> str:
    """How many times as long as the other one a row takes."""
    return number(row.seconds[1] / other.seconds[1]) if row.seconds and other.seconds else "–"

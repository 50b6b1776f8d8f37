"""What a benchmark's section of the page shows, beside its table: `SECTION` of the benchmark's module, and its words.

Imports nothing heavy: benchmarks that measure memory import this.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from bench.lib.results import Benchmark, Row

Sentence = Callable[[Benchmark], str | None]  # None: the rows have nothing of the kind


def milliseconds(row: Row) -> float:
    """Of a row that was timed."""
    return 1e3 * row.seconds[1] if row.seconds else float("nan")


@dataclass(frozen=True)
class View:
    """What one or more panels of a benchmark's picture show.

    error: key of the error drawn. label: its axis. panels: keys of `size` (or `what`) that rows of one panel share, or
    what tells its title. best: for scores that are better when higher, the score that nothing exceeds; best - score is
    drawn. keep: rows that can be compared at all. cost, cost_label: what a row takes, small is good.
    """

    error: str
    label: str
    panels: tuple[str, ...] | Callable[[Row], str] = ()
    best: float | None = None
    keep: Callable[[Row], bool] = lambda _: True
    cost: Callable[[Row], float] = milliseconds
    cost_label: str = "ms"

    def value(self, row: Row) -> float | None:
        """The error drawn; None where the row has none."""
        value = row.error.get(self.error)
        if value is None or self.best is None:
            return value
        return self.best - value

    def title(self, row: Row) -> str:
        """Of the panel that a row belongs to."""
        if callable(self.panels):
            return self.panels(row)
        known = {"what": row.what, **row.size}
        words = (
            str(known[name]) if name == "what" else f"{title(name)} {text(known.get(name))}" for name in self.panels
        )
        return ", ".join(words)


@dataclass(frozen=True)
class Section:
    """What a section shows. A benchmark without one has the first error that is positive somewhere drawn.

    views: what is drawn; None: that error. note: what the rows say of a goal. headline: a sentence of its own at the
    top of the page, where the section's picture stands too. elsewhere: a benchmark with a page of its own has no
    section; a link to that page, from reports/bench.
    """

    views: tuple[View, ...] | None = None
    note: Sentence = lambda _: None
    headline: Sentence = lambda _: None
    elsewhere: str | None = None


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


def fastest(rows: Sequence[Row]) -> Row:
    """Of those that were timed."""
    return min(rows, key=lambda row: row.seconds[1] if row.seconds else float("inf"))


def times(row: Row, other: Row) -> str:
    """How many times as long as the other one a row takes."""
    return number(row.seconds[1] / other.seconds[1]) if row.seconds and other.seconds else "–"

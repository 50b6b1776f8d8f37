"""The picture of a benchmark: time against error on logarithmic axes; rows on the frontier, or all of few, have names.

A row whose error is exactly 0 has no place on a logarithmic axis: it stands on a line of its own below all others.
"""

import io
import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib import figure, ticker  # noqa: TID251  (the package's own charts belong to its report)

from bench.lib import results

POINT, FRONTIER, EXACT, INK = "#7FA7D6", "#1F5FA8", "#9AA1AD", "#3A404A"
COLUMNS, LINE, SIDE = 3, 60, 4.3  # panels side by side; characters of a line of names; inches of a panel
NAMED, ALIKE = 8, 2.0  # a panel of no more points names all; one whose errors differ by less has nothing to choose
NARROW = 30.0  # an axis of no more than this factor needs marks between powers of ten


@dataclass(frozen=True)
class Point:
    """A row in the picture. seconds > 0, error >= 0. number: that of its line in the table."""

    number: int
    name: str
    seconds: float
    error: float


@dataclass(frozen=True)
class Panel:
    """Rows that may be compared, at least one. error: what the vertical axis shows."""

    title: str
    error: str
    points: Sequence[Point]


def draw(panels: Sequence[Panel]) -> bytes:
    """A PNG of all panels."""
    columns, lines = min(len(panels), COLUMNS), math.ceil(len(panels) / COLUMNS)
    chart = figure.Figure(figsize=(SIDE * columns, SIDE * lines), dpi=120, layout="constrained")
    grid = chart.subplots(lines, columns, squeeze=False).flatten()
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    for axes, panel in zip(grid, panels, strict=False):
        _draw(axes, panel)
    buffer = io.BytesIO()
    chart.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _draw(axes, panel: Panel) -> None:  # of matplotlib's Axes, which has no types
    points = panel.points
    positive = [point.error for point in points if point.error > 0]
    floor = min(positive) / 4 if positive else 1.0
    places = [(1e3 * point.seconds, point.error or floor) for point in points]
    if len(positive) < len(points):
        axes.axhline(floor, color=EXACT, lw=0.8, ls=(0, (4, 3)), zorder=0)
        axes.text(
            1, floor, "exact", transform=axes.get_yaxis_transform(), ha="right", va="top", fontsize=7.5, color=EXACT
        )
    best = results.frontier(places)
    axes.step(*zip(*(places[i] for i in best), strict=True), where="post", color=FRONTIER, lw=1.1, zorder=1)
    axes.scatter(*zip(*places, strict=True), s=14, color=POINT, zorder=2)
    axes.scatter(*zip(*(places[i] for i in best), strict=True), s=22, color=FRONTIER, zorder=3)
    named = range(len(points)) if len(points) <= NAMED else best
    for i in named:
        axes.annotate(str(points[i].number), places[i], (4, 3), textcoords="offset points", fontsize=7.5, color=INK)
    names = [textwrap.fill(f"{points[i].number}  {points[i].name}", LINE, subsequent_indent="     ") for i in named]
    axes.text(0, -0.17, "\n".join(names), transform=axes.transAxes, fontsize=7.5, color=INK, va="top")
    axes.set_title(panel.title, loc="left", fontsize=9.5, fontweight="bold")
    axes.set_ylabel(panel.error, fontsize=8.5)
    axes.set_xlabel("ms", fontsize=8.5, loc="right")
    axes.set(xscale="log", yscale="log")
    axes.margins(x=0.12, y=0.12)
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        axis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5) if high / low < NARROW else (1,), numticks=9))
        axis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        axis.set_minor_formatter(ticker.NullFormatter())
    axes.tick_params(labelsize=7.5)
    axes.grid(color="#E6E9EE", lw=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)

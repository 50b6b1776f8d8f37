"""The picture of a benchmark: seconds against error on logarithmic axes, rows as numbered points, the frontier drawn.

A row whose error is exactly 0 has no place on a logarithmic axis: it stands on a line of its own below all others.
"""

import io
import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

import _results
from matplotlib import figure, ticker  # noqa: TID251  (the package's own charts belong to its report)

POINT, FRONTIER, EXACT, INK = "#7FA7D6", "#1F5FA8", "#9AA1AD", "#3A404A"
COLUMNS, LONGEST_NAME, NARROW = 3, 72, 30
SIDE = (4.3, 4.3)  # inches of one panel and the names below it


@dataclass(frozen=True)
class Point:
    """A row in the picture. seconds > 0, error >= 0. number: that of its line in the table."""

    number: int
    name: str
    seconds: float
    error: float


def draw(panels: Sequence[tuple[str, Sequence[Point]]], error: str) -> bytes:
    """A PNG with a panel per group of rows that may be compared.

    Args:
      panels: title and points; at least one point each.
      error: what the vertical axis shows.
    """
    columns, lines = min(len(panels), COLUMNS), math.ceil(len(panels) / COLUMNS)
    chart = figure.Figure(figsize=(SIDE[0] * columns, SIDE[1] * lines), dpi=120, layout="constrained")
    grid = chart.subplots(lines, columns, squeeze=False).flatten()
    for panel, (title, points) in zip(grid, panels, strict=False):
        _draw_panel(panel, points)
        panel.set_title(title, loc="left", fontsize=9.5, fontweight="bold")
        panel.set_ylabel(error, fontsize=8.5)
    for panel in grid[len(panels) :]:
        panel.set_visible(False)
    buffer = io.BytesIO()
    chart.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _draw_panel(panel, points: Sequence[Point]) -> None:  # of matplotlib's Axes, which has no types
    positive = [point.error for point in points if point.error > 0]
    floor = min(positive) / 4 if positive else 1.0
    places = [(1e3 * point.seconds, point.error or floor) for point in points]
    best = _results.frontier([(point.seconds, point.error) for point in points])
    if len(positive) < len(points):
        panel.axhline(floor, color=EXACT, lw=0.8, ls=(0, (4, 3)), zorder=0)
        panel.annotate(
            "exact", (1, floor), (-2, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
            ha="right", fontsize=7.5, color=EXACT,
        )  # fmt: skip
    panel.step(*zip(*(places[i] for i in best), strict=True), where="post", color=FRONTIER, lw=1.1, zorder=1)
    for i, (point, place) in enumerate(zip(points, places, strict=True)):
        colour, weight = (FRONTIER, "bold") if i in best else (POINT, "normal")
        panel.scatter(*place, s=22 if i in best else 14, color=colour, zorder=2)
        panel.annotate(
            str(point.number), place, (4, 3), textcoords="offset points", fontsize=7.5, color=INK, weight=weight
        )
    names = (f"{points[i].number}  {textwrap.shorten(points[i].name, LONGEST_NAME, placeholder='…')}" for i in best)
    panel.text(0, -0.17, "\n".join(names), transform=panel.transAxes, fontsize=7.5, color=INK, va="top")
    panel.set_xlabel("ms", fontsize=8.5, loc="right")
    panel.set(xscale="log", yscale="log")
    panel.margins(x=0.12, y=0.12)
    for axis, (low, high) in ((panel.xaxis, panel.get_xlim()), (panel.yaxis, panel.get_ylim())):
        narrow = high / low < NARROW  # too few powers of ten to read a value by
        axis.set_major_locator(ticker.LogLocator(subs=(1, 1.5, 2, 3, 5, 7) if narrow else (1,), numticks=9))
        axis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        axis.set_minor_formatter(ticker.NullFormatter())
    panel.tick_params(labelsize=7.5)
    panel.grid(color="#E6E9EE", lw=0.7)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)

"""The picture of a benchmark: cost against error on logarithmic axes, rows as numbered points, the frontier drawn.

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
COLUMNS, LINE = 3, 60  # panels side by side; characters of a line of names
TICKS = ((30, (1, 1.5, 2, 3, 5, 7)), (300, (1, 2, 5)))  # between powers of ten, where these are too few to read by
SIDE = (4.3, 4.3)  # inches of one panel and the names below it


@dataclass(frozen=True)
class Point:
    """A row in the picture. cost > 0, error >= 0. number: that of its line in the table."""

    number: int
    name: str
    cost: float
    error: float


@dataclass(frozen=True)
class Panel:
    """Rows that may be compared, at least one. error, cost: what the vertical and the horizontal axis show."""

    title: str
    error: str
    cost: str
    points: Sequence[Point]


def draw(panels: Sequence[Panel]) -> bytes:
    """A PNG of all panels."""
    columns, lines = min(len(panels), COLUMNS), math.ceil(len(panels) / COLUMNS)
    chart = figure.Figure(figsize=(SIDE[0] * columns, SIDE[1] * lines), dpi=120, layout="constrained")
    grid = chart.subplots(lines, columns, squeeze=False).flatten()
    places = [_draw_panel(axes, panel) for axes, panel in zip(grid, panels, strict=False)]
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    chart.draw_without_rendering()  # now the axes have their final sizes
    for axes, panel, own in zip(grid, panels, places, strict=False):
        _number(axes, panel.points, own)
    buffer = io.BytesIO()
    chart.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _draw_panel(axes, panel: Panel) -> list[tuple[float, float]]:  # of matplotlib's Axes, which has no types
    """Everything but the points' numbers; where the points are."""
    points = panel.points
    positive = [point.error for point in points if point.error > 0]
    floor = min(positive) / 4 if positive else 1.0
    places = [(point.cost, point.error or floor) for point in points]
    best = _best(points)
    if len(positive) < len(points):
        axes.axhline(floor, color=EXACT, lw=0.8, ls=(0, (4, 3)), zorder=0)
        axes.annotate(
            "exact", (1, floor), (-2, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
            ha="right", fontsize=7.5, color=EXACT,
        )  # fmt: skip
    axes.step(*zip(*(places[i] for i in best), strict=True), where="post", color=FRONTIER, lw=1.1, zorder=1)
    for i, place in enumerate(places):
        axes.scatter(*place, s=22 if i in best else 14, color=FRONTIER if i in best else POINT, zorder=2)
    names = [textwrap.fill(f"{points[i].number}  {points[i].name}", LINE, subsequent_indent="     ") for i in best]
    axes.text(0, -0.17, "\n".join(names), transform=axes.transAxes, fontsize=7.5, color=INK, va="top")
    axes.set_title(panel.title, loc="left", fontsize=9.5, fontweight="bold")
    axes.set_ylabel(panel.error, fontsize=8.5)
    axes.set_xlabel(panel.cost, fontsize=8.5, loc="right")
    axes.set(xscale="log", yscale="log")
    axes.margins(x=0.12, y=0.12)
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        between = next((values for most, values in TICKS if high / low < most), (1,))
        axis.set_major_locator(ticker.LogLocator(subs=between, numticks=9))
        axis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        axis.set_minor_formatter(ticker.NullFormatter())
    axes.tick_params(labelsize=7.5)
    axes.grid(color="#E6E9EE", lw=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    return places


def _best(points: Sequence[Point]) -> list[int]:
    return results.frontier([(point.cost, point.error) for point in points])


def _number(axes, points: Sequence[Point], places: Sequence[tuple[float, float]]) -> None:
    """Write the numbers beside the points, where as little as possible lies below each."""
    best, unit = _best(points), axes.figure.dpi / 72
    spots = [tuple(spot / unit) for spot in axes.transData.transform(places)]  # in points, as offsets are
    taken = [(x - 2.5, y - 2.5, x + 2.5, y + 2.5) for x, y in spots]
    for i in sorted(range(len(points)), key=lambda i: i not in best):
        wide = 4.6 * len(str(points[i].number))
        x, y = spots[i]
        boxes = {offset: _box(x, y, wide, *offset) for offset in _OFFSETS}
        offset = min(_OFFSETS, key=lambda o: sum(_overlap(boxes[o], other) for other in taken))  # of equals the first
        taken.append(boxes[offset])
        axes.annotate(
            str(points[i].number), places[i], (boxes[offset][0] - x, boxes[offset][1] - y), textcoords="offset points",
            fontsize=7.5, color=INK, weight="bold" if i in best else "normal",
        )  # fmt: skip


_OFFSETS = tuple((side, height) for height in (3, -9, 12, -18, 21, -27) for side in (1, -1))  # points from the spot


def _box(x: float, y: float, wide: float, side: int, height: float) -> tuple[float, float, float, float]:
    """Left, lower, right and upper end of a number to the right or the left of a spot, in points."""
    left = x + 4 if side > 0 else x - 4 - wide
    return left, y + height, left + wide, y + height + 6


def _overlap(a: Sequence[float], b: Sequence[float]) -> float:
    """Area that two boxes share."""
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))

"""Growth curves of a benchmark: a measured quantity against a size, one line per method, both axes logarithmic."""

import itertools
from collections.abc import Mapping, Sequence

from matplotlib import figure, ticker  # noqa: TID251  (the package's own charts belong to its report)

from bench.lib import measuring

MOST_TICKS = 8  # sizes that are written below the axis; of more, powers of ten
COLOURS = ("#1F5FA8", "#D5702A", "#5E6673", "#3C8D5A", "#8A4FA3")


def draw(name: str, panels: Sequence[tuple[str, str, Mapping[str, Sequence[tuple[float, float]]]]], value: str) -> None:
    """`reports/bench/<name>.png`; a method has one colour in all panels.

    Args:
      panels: title, what the x axis counts, and per method its (x, value) points. value: what the y axis shows.
    """
    methods = dict.fromkeys(method for _, _, curves in panels for method in curves)
    colours = dict(zip(methods, itertools.cycle(COLOURS), strict=False))
    chart = figure.Figure(figsize=(4.4 * len(panels), 3.4 + 0.2 * len(methods)), dpi=130, layout="constrained")
    lines = {}
    for panel, (title, size, curves) in zip(chart.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        for method, points in curves.items():
            xs, ys = zip(*sorted(points), strict=True)
            (lines[method],) = panel.plot(xs, ys, "o-", color=colours[method], markersize=4)
        panel.set(xscale="log", yscale="log", title=title, xlabel=size, ylabel=value)
        ticks = sorted({x for points in curves.values() for x, _ in points})
        if len(ticks) <= MOST_TICKS:
            panel.set_xticks(ticks, [f"{x:,.0f}" for x in ticks])
            panel.xaxis.set_minor_locator(ticker.NullLocator())
        else:
            panel.xaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        panel.yaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        panel.grid(color="#E6E9EE")
        panel.spines[["top", "right"]].set_visible(False)
    chart.legend(lines.values(), lines, loc="outside lower left", frameon=False, fontsize=8)
    measuring.OUT.mkdir(parents=True, exist_ok=True)
    chart.savefig(measuring.OUT / f"{name}.png", metadata={"Software": None})

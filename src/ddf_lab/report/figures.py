"""Charts, as SVG text; the only module that imports matplotlib.

Text is drawn as outlines, so a chart looks the same everywhere, and nothing in the file depends on the day it was made.
Panels stand two in a line, so that a chart can be read on a phone, 400 pixels wide.
One colour per method in every chart: blue for DDF, orange for PC-SIREN, green for DDF+image.
"""

import io
import re
from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
from matplotlib import figure, ticker

METHOD_COLOURS = {"ddf": "#1F5FA8", "pc_siren": "#D5702A", "ddf_image": "#2E7D4F"}
_NAMES = {"ddf": "DDF", "pc_siren": "PC-SIREN", "ddf_image": "DDF+image"}
_EQUAL = "#5E6673"  # of the line of equals
_SHADES = matplotlib.colormaps["tab10"](range(10))  # of the terms of a loss
_TOTAL = "#22262E"
_DASHES = ("-", "--")  # of the first ten, of the others
_MAX_POINTS = 400  # of a curve: more cannot be told apart, and the file stays small
_PANELS_IN_LINE = 2
_WIDTH = 5.6  # of every chart, inches
_POINTS_PER_INCH = 94  # of a shown chart: 72 is its true size, a little small on a screen
_STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#9AA1AD",
    "axes.labelcolor": "#3A404A",
    "axes.axisbelow": True,
    "xtick.color": "#5A616D",
    "ytick.color": "#5A616D",
    "axes.grid": True,
    "grid.color": "#E6E9EE",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "ddf",
}
_styled = matplotlib.rc_context(_STYLE)


@_styled
def score_dots(scores: Mapping[str, pd.DataFrame], across: str, up: str) -> str:
    """One panel per category: a method's score over that in column `nearest`, a dot per row, and the line of equals.

    Args:
      scores: category to table, with column `nearest` and one of each method, from 0 to 100.
      across, up: labels of the axes.
    """
    columns = min(len(scores), _PANELS_IN_LINE)
    lines = -(-len(scores) // columns)
    chart = figure.Figure(figsize=(_WIDTH, 2.6 * lines), layout="constrained")
    panels = list(chart.subplots(lines, columns, squeeze=False).flat)
    for empty in panels[len(scores) :]:
        empty.remove()
    for panel, (category, table) in zip(panels, scores.items(), strict=False):
        panel.plot([0, 100], [0, 100], lw=0.9, color=_EQUAL)
        for method in table.columns.drop("nearest"):
            dots = {"ms": 4, "alpha": 0.8, "mew": 0, "color": METHOD_COLOURS[method], "label": _NAMES[method]}
            panel.plot(table["nearest"], table[method], "o", **dots)
        least = 10 * np.floor(np.nanmin(table.to_numpy()) / 10 - 0.2)  # the dots, and no more, but square
        panel.set(title=category, xlim=(least, 102), ylim=(least, 102), aspect="equal", xlabel=across, ylabel=up)
    chart.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=len(_NAMES))
    return _svg(chart)


@_styled
def loss_curves(logs: Mapping[str, Mapping[str, pd.DataFrame]]) -> str:
    """Training losses: a line of panels per model, one per category; the total thick and dark, its terms thin.

    Args:
      logs: model's name to category to log (columns `step`, `loss`, then terms, `seconds`).
    """
    chart = figure.Figure(figsize=(_WIDTH, 2.9 * len(logs)), layout="constrained")
    for part, (model, tables) in zip(chart.subfigures(len(logs), squeeze=False).flat, logs.items(), strict=True):
        panels = part.subplots(1, len(tables), sharex=True, sharey=True, squeeze=False)[0]
        for panel, (category, log) in zip(panels, tables.items(), strict=True):
            _draw_losses(panel, log)
            panel.set(title=category, xlabel="step")
        panels[0].set_ylabel(f"loss of {model}")
        handles = panels[0].get_legend_handles_labels()
        part.legend(*handles, loc="outside lower center", fontsize=8.5, handlelength=1.2, ncols=3)
    return _svg(chart)


def _draw_losses(panel: Any, log: pd.DataFrame) -> None:
    thin = log.iloc[:: max(1, -(-len(log) // _MAX_POINTS))]
    terms = [name for name in log.columns if name not in ("step", "loss", "seconds")]
    lifted = 0.0  # of the total too, which may fall below 0 with them
    for i, name in enumerate(terms):
        values = thin[name].to_numpy(dtype=np.float64)
        if (values < 0).any():  # the normals' term is -|cosine|, in [-1, 0]; one more is an error again
            values, name, lifted = values + 1.0, f"{name} + 1", lifted + 1.0
        shown, label = np.where(values > 0, values, np.nan), name.replace("_", " ")
        panel.plot(thin["step"], shown, lw=0.9, color=_SHADES[i % 10], ls=_DASHES[i // 10 % 2], label=label)
    window = max(1, len(log) // 40)
    total = log["loss"] + lifted
    smooth = total.rolling(window, min_periods=1, center=True).mean().iloc[thin.index]
    panel.plot(thin["step"], total.iloc[thin.index], lw=0.5, alpha=0.35, color=_TOTAL)
    panel.plot(thin["step"], smooth, lw=1.8, color=_TOTAL, label=f"total + {lifted:.0f}" if lifted else "total")
    if (total > 0).all():
        panel.set_yscale("log")
        panel.yaxis.set_minor_formatter(ticker.NullFormatter())
    panel.xaxis.set_major_locator(ticker.MaxNLocator(2))


def _svg(chart: figure.Figure) -> str:
    buffer = io.StringIO()
    chart.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    width, height = (f"{inches * _POINTS_PER_INCH:g}pt" for inches in chart.get_size_inches())
    return re.sub(
        r'width="[\d.]+pt" height="[\d.]+pt"', f'width="{width}" height="{height}"', buffer.getvalue(), count=1
    )

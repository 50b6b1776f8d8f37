"""Charts: valid SVG, equal bytes, values as text-free marks in the right number, nothing that depends on the day."""

import xml.etree.ElementTree as ElementTree

import numpy as np
import pandas as pd
import pytest

from ddf_lab.report import figures

_STEPS = np.arange(0, 1000, 10)
_LOG = pd.DataFrame({"step": _STEPS, "loss": 3 * np.exp(-_STEPS / 300), "normals": -np.linspace(0.1, 0.9, 100)})
_DOTS = pd.DataFrame({"nearest": [40.0, 60.0, 80.0], "ddf": [50.0, 60.0, 70.0], "pc_siren": [30.0, 20.0, 10.0]})
_CHARTS = {
    "dots": lambda: figures.score_dots({"chair": _DOTS, "car": _DOTS}, "nearest", "model"),
    "losses": lambda: figures.loss_curves({"DDF": {"chair": _LOG}, "PC-SIREN": {"chair": _LOG[["step", "loss"]]}}),
}


@pytest.mark.parametrize("name", _CHARTS)
def test_charts_are_svg_with_equal_bytes_and_no_date(name):
    first, second = _CHARTS[name](), _CHARTS[name]()
    assert first == second
    root = ElementTree.fromstring(first)
    assert root.tag.endswith("svg") and float(root.attrib["width"].removesuffix("pt")) > 100
    assert "<dc:date>" not in first and "<text" not in first  # text is drawn as outlines
    assert len(first) < 200_000


def test_every_loss_term_is_drawn_and_a_total_below_zero_does_not_dive():
    log = _LOG.assign(loss=_LOG["loss"] + _LOG["normals"], weight_variance=0.1)
    assert log["loss"].min() < 0
    panel = figures.figure.Figure().subplots()
    figures._draw_losses(panel, log, "black")
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in panel.lines}
    assert {"normals + 1", "weight variance", "total + 1"} <= set(lines) and panel.get_yscale() == "log"
    assert len(lines["normals + 1"]) == len(_LOG) and np.isfinite(lines["normals + 1"]).all()
    assert lines["total + 1"].min() == pytest.approx(log["loss"].min() + 1, abs=0.01)

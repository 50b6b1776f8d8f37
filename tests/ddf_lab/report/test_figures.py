"""Charts: every term is drawn, on a scale that holds it."""

import numpy as np
import pandas as pd
import pytest

from ddf_lab.report import figures

_STEPS = np.arange(0, 1000, 10)
_LOG = pd.DataFrame({"step": _STEPS, "loss": 3 * np.exp(-_STEPS / 300), "normals": -np.linspace(0.1, 0.9, 100)})


def test_every_loss_term_is_drawn_and_a_total_below_zero_does_not_dive():
    log = _LOG.assign(loss=_LOG["loss"] + _LOG["normals"], weight_variance=0.1)
    assert log["loss"].min() < 0
    panel = figures.figure.Figure().subplots()
    figures._draw_losses(panel, log, "black")
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in panel.lines}
    assert {"normals + 1", "weight variance", "total + 1"} <= set(lines) and panel.get_yscale() == "log"
    assert len(lines["normals + 1"]) == len(_LOG) and np.isfinite(lines["normals + 1"]).all()
    assert lines["total + 1"].min() == pytest.approx(log["loss"].min() + 1, abs=0.01)

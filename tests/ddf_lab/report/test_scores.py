"""Numbers as printed: means over nothing are dashes."""

import math

import pandas as pd

from ddf_lab.evaluation import scoring
from ddf_lab.report import scores, stage_results

_CHAMFER = "chamfer_l2_sq_x1000"


def _table(*rows):
    """Rows of category, method, D_C, images."""
    full = [(c, m, "Pi_g-L", _CHAMFER, value, images, 1, math.nan, scoring.MEASURED) for c, m, value, images in rows]
    return pd.DataFrame(full, columns=list(scoring.TABLE_FIELDS))


def _results(*rows):
    """Results of which the table is known, and no score of an image."""
    scored = pd.DataFrame(columns=["category", "method", "column", "id", "view", "chamfer_l2_sq"])
    empty = pd.DataFrame()
    return stage_results.Results("x", {}, _table(*rows), [scored], empty, {}, empty, {}, {})


def test_a_mean_over_nothing_is_a_dash():
    table = _table(("car", "ddf", math.nan, 0), ("car", "pc_siren", 2.0, 5))
    found = scores.Scores(table)
    head = ("ddf", "Pi_g-L")
    assert found.text("car", head, _CHAMFER) == "–"
    assert scores.number(math.nan, 2) == scores.number(None, 2) == "–" and scores.number(0.0, 2) == "0.00"


def test_methods_without_any_number_give_no_table():
    methods = (("P2M", "p2m"), ("3DR", "3dr"))
    assert scores.pairs(_results(("car", "ddf", 1.0, 5)), ["car"], ["Pi_g-L"], methods, "") is None

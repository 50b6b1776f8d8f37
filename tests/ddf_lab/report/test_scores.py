"""Numbers as printed: means over nothing are dashes, image counts stand where they belong."""

import math

import pandas as pd
import pytest

from ddf_lab.evaluation import scoring
from ddf_lab.report import pages, scores, stage_results

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
    assert found.value("car", head, _CHAMFER) is None and found.text("car", head, _CHAMFER) == "–"
    assert scores.number(math.nan, 2) == scores.number(None, 2) == "–" and scores.number(0.0, 2) == "0.00"


@pytest.mark.parametrize(
    ("counts", "note", "cells"),
    [
        ({"car": (5, 5), "chair": (5, 5)}, "5 images of each category.", "1.000"),
        ({"car": (5, 5), "chair": (4, 4)}, "Images: car 5, chair 4.", "1.000"),
        ({"car": (5, 5), "chair": (5, 4)}, "", "1.000 (4)"),
    ],
)
def test_image_counts_are_in_the_caption_or_in_every_cell(counts, note, cells):
    rows = [(c, m, 1.0, n) for c, both in counts.items() for m, n in zip(("ddf", "pc_siren"), both, strict=True)]
    methods = (("DDF", "ddf"), ("PC-SIREN", "pc_siren"))
    results = _results(*rows)
    table = scores.pairs(results, list(counts), ["Pi_g-L"], methods, "Words.")
    heads = [(method, "Pi_g-L") for _, method in methods]
    assert table is not None and scores.images_note(scores.Scores(results.table), counts, heads, _CHAMFER) == note
    cell = table.rows[1][3]
    assert isinstance(cell, pages.Cell) and cell.text == cells
    assert len(table.header) == 8


def test_methods_without_any_number_give_no_table():
    methods = (("P2M", "p2m"), ("3DR", "3dr"))
    assert scores.pairs(_results(("car", "ddf", 1.0, 5)), ["car"], ["Pi_g-L"], methods, "") is None

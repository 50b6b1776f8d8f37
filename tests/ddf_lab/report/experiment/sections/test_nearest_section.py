"""Scores of test shapes beside that of the training shape nearest to each."""

import types
from typing import Any

import pandas as pd
import pytest
from _experiment_report import markdown_tables

from ddf_lab.report.experiment.sections import nearest


def _scored(**scores):
    """Scores per image, of method to shape to F of its images; another column and category that are not to be read."""
    rows = [
        ("chair", method, "Pi_g-L", shape, value)
        for method, shapes in scores.items()
        for shape, values in shapes.items()
        for value in values
    ]
    rows += [("chair", "ddf", "Pi_g-S", "a", 0.9), ("plane", "ddf", "Pi_g-L", "a", 0.9)]
    return pd.DataFrame(rows, columns=["category", "method", "column", "id", "f_score_tau"])


def _results(*trainings) -> Any:
    return types.SimpleNamespace(trainings=trainings, seeds=len(trainings), groups={"chair": "chair"})


def test_a_shape_is_the_mean_of_its_images_and_of_all_trainings():
    rival = {"a": [0.75, 0.75], "b": [0.625, 0.625], "c": [0.125, 0.125]}
    first = _scored(
        oracle_retrieval={"a": [0.5], "b": [0.625], "c": [0.875]},
        ddf={"a": [0.25, 0.5], "b": [0.75, 0.75], "c": [1.0, 1.0]},
        pc_siren=rival,
    )
    second = _scored(ddf={"a": [0.5, 0.75], "b": [0.75, 0.75], "c": [0.625, 0.625]}, pc_siren=rival)
    results = _results(first, second)
    found = nearest.by_shape(results, "chair")
    assert found.loc["a"].to_dict() == pytest.approx({"nearest": 50, "ddf": 50, "pc_siren": 75})
    assert found["ddf"].tolist() == pytest.approx([50, 75, 81.25])
    table = nearest.table(results, {"chair": found})
    # what lies on the line is not above it: a of the DDF, b of the rival
    assert table.rows == [["chair", "3", "1.00", "1", "-1.00", "1"]] and "Means over 2 seeds." in table.caption


def test_two_shapes_have_no_correlation():
    scores = {"a": [0.4], "b": [0.5]}
    results = _results(_scored(oracle_retrieval=scores, ddf=scores, pc_siren=scores))
    table = nearest.table(results, {"chair": nearest.by_shape(results, "chair")})
    assert table.rows == [["chair", "2", "–", "0", "–", "0"]]


def test_every_group_has_its_line_and_its_panel(reported):
    text = (reported[2] / "README.md").read_text()
    rows = next(rows for rows in markdown_tables(text) if rows[0][1] == "shapes")
    assert [row[:2] for row in rows[2:]] == [[name, "2"] for name in ("chair", "plane", "primitives")]
    assert "](nearest.svg)" in text

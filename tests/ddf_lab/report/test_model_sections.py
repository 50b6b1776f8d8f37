"""Tables of the models; that numbers and bold are right is told by test_recomputed."""

import dataclasses
import types
from typing import Any

import pandas as pd
import pytest
from scipy import stats

from ddf_lab.evaluation import scoring
from ddf_lab.report import model_sections, pages, stage_results


def test_effects_are_over_the_next_model_and_their_interval_is_of_a_paired_test(reported):
    """Of one training SciPy's interval over shapes."""
    results = stage_results.read_results(reported[1])
    scored = results.per_image
    more = pd.concat([scored.assign(id=scored["id"] + str(number)) for number in range(8)])
    results = dataclasses.replace(results, trainings=[more])
    (table, *_) = model_sections.results_section(results).blocks
    assert isinstance(table, pages.Table)
    row = model_sections.effects(results, table).rows[0]
    chairs = more[(more["category"] == "chair") & (more["column"] == "Pi_g-L")]
    of_shapes = chairs.groupby(["method", "id"])["f_score_tau"].mean()
    means = {name: of_shapes[own] for name, own in model_sections.MODELS}
    best, second, _ = sorted(means, key=lambda name: -means[name].mean())
    low, high = stats.ttest_rel(means[best], means[second]).confidence_interval()
    assert row[4] == best and row[6] == str(len(means[best]))
    assert isinstance(row[5], pages.Cell) and row[5].text == f"{50 * (low + high):.2f} ± {50 * (high - low):.2f}"


def test_shapes_on_the_mask_have_a_table_of_their_own(reported):
    """Work at test time that the other model is not given stands in no column beside it."""
    results = stage_results.read_results(reported[1])
    moved = results.per_image[results.per_image["method"] == scoring.DDF].assign(method=scoring.DDF_ON_MASK)
    table = results.table[results.table["method"] == scoring.DDF].assign(method=scoring.DDF_ON_MASK)
    scored = pd.concat([results.per_image, moved])
    both = dataclasses.replace(results, trainings=[scored], table=pd.concat([results.table, table]))
    blocks = model_sections.results_section(both).blocks
    (mask,) = (block for block in blocks if isinstance(block, pages.Table) and "on the mask" in block.header[3])
    assert not any(isinstance(cell, pages.Cell) and cell.best for row in mask.rows for cell in row)  # the same scores


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
    perfect = {name: [1.0, 1.0] for name in "abc"}
    rival = {"a": [0.75, 0.75], "b": [0.625, 0.625], "c": [0.125, 0.125]}
    first = _scored(
        oracle_retrieval={"a": [0.5], "b": [0.625], "c": [0.875]},
        ddf={"a": [0.25, 0.5], "b": [0.75, 0.75], "c": [1.0, 1.0]},
        pc_siren=rival,
        ddf_image=perfect,
    )
    ours = {"a": [0.5, 0.75], "b": [0.75, 0.75], "c": [0.625, 0.625]}
    (row,) = model_sections.distribution(_results(first.replace("Pi_g-L", "Pi_pred-L"))).rows
    assert row == ["chair", "38 / 75 / 100", "12 / 62 / 75", "100 / 100 / 100"]
    second = _scored(ddf=ours, pc_siren=rival, ddf_image=perfect)
    found = model_sections.by_shape(_results(first, second), "chair")
    assert found.loc["a"].to_dict() == pytest.approx({"nearest": 50, "ddf": 50, "pc_siren": 75, "ddf_image": 100})
    assert found["ddf"].tolist() == pytest.approx([50, 75, 81.25])
    # what lies on the line is not above it: a of the DDF, b of the rival
    assert model_sections.nearest_table({"chair": found}).rows == [["chair", "3", "1.00", "1", "-1.00", "1", "–", "3"]]


def test_relatives_have_rows_of_their_own():
    scores = {"a": [0.95], "b": [0.9], "c": [0.5]}
    ours = {"a": [0.9], "b": [0.8], "c": [0.6]}
    scored = _scored(oracle_retrieval=scores, ddf=ours, pc_siren=scores, ddf_image=ours)
    found = model_sections.by_shape(_results(scored), "chair")
    table = model_sections.relatives_table({"chair": found, "car": found[found["nearest"] < 90]})
    assert table is not None and table.rows == [
        ["chair", "near", "1", "95.00", "90.00", "95.00", "90.00"],
        ["", "others", "2", "70.00", "70.00", "70.00", "70.00"],
    ]
    assert model_sections.relatives_table({"car": found[found["nearest"] < 90]}) is None
    two = model_sections.nearest_table({"chair": found[:2]})  # have no correlation
    assert two.rows == [["chair", "2", "–", "0", "–", "0", "–", "0"]]

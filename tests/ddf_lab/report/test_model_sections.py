"""Tables of the models: every number is that of si3dr.csv, bold and verdict say what the numbers say."""

import dataclasses
import itertools
import types
from typing import Any

import pandas as pd
import pytest
from _experiment_report import markdown_tables
from scipy import stats

from ddf.metrics import cloud_scores
from ddf_lab.evaluation import claims, paper_results, scoring
from ddf_lab.report import model_sections, pages, scores, stage_results

_METRICS = ("chamfer_l2_sq_x1000", "f_score_tau_x100")
_COMPARED = [(metric, method) for metric in _METRICS for _, method in model_sections.MODELS]
_PAIRED = [(metric, method) for metric in cloud_scores.PRINTED for _, method in model_sections.MODELS[:2]]
_CATEGORIES = ("chair", "plane", "primitives")


def _printed(value, key, digits):
    return f"{value[key]:.{digits}f}" if key in value else "–"


def test_printed_values_are_those_of_the_table(reported):
    _, _, folder = reported
    table = pd.read_csv(folder / "si3dr.csv")
    assert tuple(table.columns) == scoring.TABLE_FIELDS
    value = table.set_index(["source", "category", "method", "column", "metric"])["value"].to_dict()
    text = (folder / "README.md").read_text()
    _, ours, shares, of_three, theirs, baselines = markdown_tables(text)[:6]
    assert "4 images of each category." in text
    large, every = model_sections.LARGE, model_sections.COLUMNS
    of_paper = _CATEGORIES[:2]  # it has no primitives
    three = [method + scoring.THREE_VIEWS for _, method in model_sections.MODELS]
    for rows, source, columns, names, keys_of in (
        (ours, "measured", every, _CATEGORIES, _COMPARED),
        (of_three, "measured", large[:1], _CATEGORIES, [(metric, own) for metric in _METRICS for own in three]),
        (theirs, paper_results.SOURCE, large, of_paper, _PAIRED),
    ):
        keys = [(category, column) for category in names for column in columns]
        assert [row[1] for row in rows[2:]] == [scores.column_label(column) for _, column in keys]
        for (category, column), row in zip(keys, rows[2:], strict=True):
            assert row[0] == (category if column == columns[0] else "")
            assert row[2:] == [
                _printed(value, (source, category, method, column, metric), cloud_scores.METRICS[metric].digits)
                for metric, method in keys_of
            ]
    names = [(m, method) for m in ("precision_tau_x100", "recall_tau_x100") for _, method in model_sections.MODELS]
    assert shares[2][2:] == [_printed(value, ("measured", "chair", method, "Pi_g-L", m), 1) for m, method in names]
    spacing = cloud_scores.METRICS["spacing_variation"]
    for i, row in enumerate(baselines[2:]):
        key = _CATEGORIES[i // 7], model_sections.BASELINES[i % 7]
        assert row[2:] == [
            _printed(value, ("measured", *key, "Pi_g-L", metric), each.digits)
            for metric, each in (*cloud_scores.PRINTED.items(), (spacing.name, spacing))
        ]


def test_bold_is_the_better_model_where_a_difference_is_seen(reported):
    results = stage_results.read_results(reported[1])
    scored = results.per_image  # two shapes of a category would claim nothing
    more = pd.concat([scored.assign(id=scored["id"] + str(number)) for number in range(8)])
    results = dataclasses.replace(results, trainings=[more])
    table = scores.pairs(
        results,
        results.groups,
        model_sections.COLUMNS,
        model_sections.MODELS,
        "",
        labels=dict(zip(_METRICS, "DF", strict=True)),
    )
    assert table is not None
    ways = [(method, column) for column in model_sections.COLUMNS for _, method in model_sections.MODELS]
    there = scores.Scores(results.table).rows
    asked = {
        (category, one, two, metric)
        for category, metric in itertools.product(_CATEGORIES, _METRICS)
        for one, two in itertools.combinations(ways, 2)
        if one[1] == two[1] and one[1].endswith("-L")
        if {(category, *one, metric), (category, *two, metric)} <= there.keys()
    }
    better, bold = claims.better(results.trainings, asked), 0
    for i, (_, _, *cells) in enumerate(table.rows):
        category, column = _CATEGORIES[i // 5], model_sections.COLUMNS[i % 5]
        heads = [(method, column) for _, method in model_sections.MODELS]
        best = [isinstance(cell, pages.Cell) and cell.best for cell in cells]
        for triple, metric in zip((best[:3], best[3:]), _METRICS, strict=True):
            rivals = [head for head in heads if (category, *head, metric) in there]
            won = [
                len(rivals) > 1
                and head in rivals
                and all((category, head, other, metric) in better for other in rivals if other != head)
                for head in heads
            ]
            assert triple == won
            bold += sum(won)
    assert bold > 0


def test_effects_are_over_the_next_model_and_their_interval_is_of_a_paired_test(reported):
    """Of one training SciPy's interval over shapes."""
    results = stage_results.read_results(reported[1])
    scored = results.per_image
    more = pd.concat([scored.assign(id=scored["id"] + str(number)) for number in range(8)])
    results = dataclasses.replace(results, trainings=[more])
    (table, *_) = model_sections.results_section(results).blocks
    row = model_sections.effects(results, table).rows[0]
    means = {
        name: more[(more["category"] == "chair") & (more["method"] == own) & (more["column"] == "Pi_g-L")]
        .groupby("id")["f_score_tau"]
        .mean()
        for name, own in model_sections.MODELS
    }
    best, second, _ = sorted(means, key=lambda name: -means[name].mean())
    low, high = stats.ttest_rel(means[best], means[second]).confidence_interval()
    assert row[4] == best and row[6] == str(len(means[best]))
    assert row[5].text == f"{50 * (low + high):.2f} ± {50 * (high - low):.2f}"


def test_shapes_on_the_mask_have_a_table_of_their_own(reported):
    """Work at test time that the other model is not given stands in no column beside it."""
    results = stage_results.read_results(reported[1])
    moved = results.per_image[results.per_image["method"] == scoring.DDF].assign(method=scoring.DDF_ON_MASK)
    table = results.table[results.table["method"] == scoring.DDF].assign(method=scoring.DDF_ON_MASK)
    both = dataclasses.replace(
        results, trainings=[pd.concat([results.per_image, moved])], table=pd.concat([results.table, table])
    )
    blocks = model_sections.results_section(both).blocks
    (mask,) = (block for block in blocks if isinstance(block, pages.Table) and "on the mask" in block.header[3])
    assert not any(isinstance(cell, pages.Cell) and cell.best for row in mask.rows for cell in row)  # the same scores


def test_seconds_of_a_test_image_stand_beside_the_columns(reported):
    results = stage_results.read_results(reported[1])
    assert model_sections.seconds(results) is None  # the fake noted none
    noted = {
        "DDF": {"encoders": 0.1, "cloud": 1.0, "camera_correction": 0.5},
        "PC-SIREN": {"encoders": 0.2, "cloud": 0.01},
    }
    table = model_sections.seconds(dataclasses.replace(results, seconds=noted))
    assert table is not None and [row[1:] for row in table.rows] == [
        ["DDF", "1.10"],
        ["PC-SIREN", "0.21"],
        ["DDF", "1.60"],
    ]


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
    second = _scored(ddf=ours, pc_siren=rival, ddf_image=perfect)
    found = model_sections.by_shape(_results(first, second), "chair")
    assert found.loc["a"].to_dict() == pytest.approx({"nearest": 50, "ddf": 50, "pc_siren": 75, "ddf_image": 100})
    assert found["ddf"].tolist() == pytest.approx([50, 75, 81.25])
    # what lies on the line is not above it: a of the DDF, b of the rival
    assert model_sections.nearest_table({"chair": found}).rows == [["chair", "3", "1.00", "1", "-1.00", "1", "–", "3"]]


def test_relatives_have_rows_of_their_own():
    scores = {"a": [0.95], "b": [0.9], "c": [0.5]}
    ours = {"a": [0.9], "b": [0.8], "c": [0.6]}
    found = model_sections.by_shape(
        _results(_scored(oracle_retrieval=scores, ddf=ours, pc_siren=scores, ddf_image=ours)), "chair"
    )
    table = model_sections.relatives_table({"chair": found, "car": found[found["nearest"] < 90]})
    assert table is not None and table.rows == [
        ["chair", "near", "1", "95.00", "90.00", "95.00", "90.00"],
        ["", "others", "2", "70.00", "70.00", "70.00", "70.00"],
    ]
    assert model_sections.relatives_table({"car": found[found["nearest"] < 90]}) is None


def test_two_shapes_have_no_correlation():
    scores = {"a": [0.4], "b": [0.5]}
    results = _results(_scored(oracle_retrieval=scores, ddf=scores, pc_siren=scores, ddf_image=scores))
    table = model_sections.nearest_table({"chair": model_sections.by_shape(results, "chair")})
    assert table.rows == [["chair", "2", "–", "0", "–", "0", "–", "0"]]

"""Standard errors, Student's t and Holm's correction: closed forms, and trainings that were simulated."""

import dataclasses
import io

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from ddf.core import checks
from ddf.metrics import cloud_scores
from ddf_lab.evaluation import claims

CHAMFER, F_SCORE = "chamfer_l2_sq_x1000", "f_score_tau_x100"
OURS, THEIRS = ("ddf", "Pi_g-L"), ("pc_siren", "Pi_g-L")


def _table(ours, theirs=None, views=2):
    """D_C x 1000 of two methods by shape, the views around it; F x 100 is its negative."""
    rows = [
        {"category": "car", "method": method, "column": "Pi_g-L", "id": str(i), "view": view, "chamfer_l2_sq": d / 1000}
        for method, values in (("ddf", ours), ("pc_siren", [5.0] * len(ours) if theirs is None else theirs))
        for i, value in enumerate(values)
        for view in range(views)
        for d in [value + 0.1 * (view - (views - 1) / 2)]
    ]
    table = pd.DataFrame(rows)
    return table.assign(f_score_tau=-10 * table["chamfer_l2_sq"])


def test_over_shapes_of_one_training_the_error_is_that_of_paired_scores():
    random = np.random.default_rng(0)
    first, second = random.normal([[[0.8]], [[0.0]]], 1, size=(2, 1, 9))
    found, asked = claims.difference(first, second), stats.ttest_rel(first[0], second[0])
    assert found.mean == pytest.approx(asked.statistic * found.error)
    assert found.error == pytest.approx(np.std(first - second, ddof=1) / 3)
    assert (found.freedom, found.chance) == pytest.approx((8, asked.pvalue))
    assert (found.shapes, found.trainings) == (9, 1)


def test_trainings_of_two_models_are_not_paired_whatever_their_order():
    """Where shapes do not matter, the test is Welch's of the trainings' means."""
    first, second = np.repeat([[1.0], [2.0], [6.0]], 2, axis=1), np.repeat([[0.0], [0.5], [1.0]], 2, axis=1)
    found, asked = claims.difference(first, second), stats.ttest_ind(first[:, 0], second[:, 0], equal_var=False)
    assert found.error == pytest.approx(np.sqrt(np.var([1, 2, 6], ddof=1) / 3 + np.var([0, 0.5, 1], ddof=1) / 3))
    assert (found.freedom, found.chance) == pytest.approx((asked.df, asked.pvalue))
    turned = claims.difference(first, second[::-1])
    assert dataclasses.astuple(turned) == pytest.approx(dataclasses.astuple(found))


def test_shapes_and_trainings_add_up():
    first = np.array([[1.0, 2.0, 6.0], [3.0, 4.0, 5.0]])
    found = claims.difference(first, np.zeros((1, 3)))  # no training changes the second
    over_shapes, over_trainings = np.var([2, 3, 5.5], ddof=1) / 3, np.var([3, 4], ddof=1) / 2
    assert found.error == pytest.approx(np.sqrt(over_shapes + over_trainings))
    squares = over_shapes**2 / 2 + over_trainings**2
    assert found.freedom == pytest.approx((over_shapes + over_trainings) ** 2 / squares)


def test_one_shape_claims_nothing_and_what_never_varies_all():
    assert claims.difference(np.array([[3.0]]), np.array([[1.0]])).chance == 1
    assert claims.difference(np.ones((1, 3)), np.zeros((1, 3))).chance == 0
    assert claims.difference(np.ones((1, 3)), np.ones((1, 3))).chance == 1


@pytest.mark.parametrize(
    ("chances", "claimed"),
    [  # Holm 1979: .05 / 4, / 3, / 2, / 1, in order of size, until one fails
        ([0.01, 0.04, 0.03, 0.005], {0, 3}),
        ([0.02, 0.001, 0.001, 0.001], {0, 1, 2, 3}),
        ([0.013, 0.013, 0.013, 0.013], set()),
        ([0.05], {0}),
        ([], set()),
    ],
)
def test_all_comparisons_of_a_table_are_corrected_together(chances, claimed):
    assert claims.holm(dict(enumerate(chances))) == claimed


def test_a_table_without_differences_is_rarely_claimed_to_have_one():
    """Shapes, trainings and what both do together vary; of 20 tables of ten comparisons one may have a claim."""
    random, wrong = np.random.default_rng(0), 0
    for _ in range(100):
        chances = {}
        for number in range(10):
            shapes, trainings = random.normal(size=40), random.normal(size=(2, 3, 1))
            first, second = shapes + 0.1 * trainings + random.normal(size=(2, 3, 40))
            chances[number] = claims.difference(first, second).chance
        wrong += bool(claims.holm(chances))
    assert wrong <= 11


@pytest.mark.parametrize(("gaps", "sign"), [([-1.0, -1.2, -0.8], 1), ([1.0, 1.2, 0.8], -1), ([1.0, -1.2, 0.8], 0)])
def test_better_follows_the_direction_of_the_metric(gaps, sign):
    table = _table([5 + gap for gap in gaps])
    for metric in (CHAMFER, F_SCORE):  # both say the same of the two methods
        ahead, behind = ("car", OURS, THEIRS, metric), ("car", THEIRS, OURS, metric)
        for asked in (ahead, behind):
            assert claims.better([table], {asked}) == {1: {ahead}, -1: {behind}, 0: set()}[sign]


def _of(tables, category):
    scored = [claims.by_head(table) for table in tables]
    return claims.of_tables(scored, category, OURS, THEIRS, cloud_scores.METRICS[CHAMFER])


def test_images_of_a_shape_are_one_case_in_the_units_of_tables():
    found = _of([_table([6.0, 7.0, 8.0]), _table([7.0, 8.0, 12.0])], "car")
    assert found is not None and (found.mean, found.shapes, found.trainings) == (pytest.approx(3), 3, 2)
    alone = _of([_table([6.0, 7.0, 8.0], views=1)], "car")
    assert alone is not None and alone.error == pytest.approx(1 / np.sqrt(3))


def test_a_method_without_training_is_compared_with_every_training():
    first, second = _table([6.0, 7.0, 8.0]), _table([7.0, 8.0, 12.0])
    found = _of([first, second[second["method"] == "ddf"]], "car")
    assert found is not None and found.mean == pytest.approx(3.0) and found.trainings == 2


def test_what_has_no_score_or_other_images_is_no_difference():
    table = _table([1.0, 2.0])
    assert _of([table], "chair") is None
    assert claims.better([table], {("chair", OURS, THEIRS, CHAMFER)}) == set()
    with pytest.raises(checks.InputError, match="not scored on the same images"):
        _of([table.iloc[:-1]], "car")
    with pytest.raises(checks.InputError, match="not scored on the same shapes"):
        _of([table, _table([1.0, 2.0, 3.0])], "car")


def test_scores_that_git_keeps_say_the_same():
    names = [metric.score for metric in cloud_scores.METRICS.values()]
    table = _table([1.23456789, 2.0]).reindex(columns=[*claims.IMAGE, *names])
    kept = pd.read_csv(io.StringIO(claims.as_text([table, table])), dtype={"id": str})
    assert list(kept.columns) == [*claims.IMAGE, *names, "training"] and len(kept) == 2 * len(table)
    one = kept[kept["training"] == 1].drop(columns="training").reset_index(drop=True)
    columns = [*claims.IMAGE, "chamfer_l2_sq"]
    pd.testing.assert_frame_equal(one[columns], table[columns], rtol=1e-4)

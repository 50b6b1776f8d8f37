"""Paired differences and their standard errors, against sums by hand and against simulated trainings."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from ddf.core import checks
from ddf.metrics import cloud_scores
from ddf_lab.evaluation import paired

CHAMFER, F_SCORE = cloud_scores.METRICS["chamfer_l2_sq_x1000"], cloud_scores.METRICS["f_score_tau_x100"]
OURS, THEIRS = ("ddf", "Pi_g-L"), ("pc_siren", "Pi_g-L")


def _table(gaps, views=2, score="chamfer_l2_sq", factor=1000.0):
    """Scores of two methods that differ by `gaps`, in the units of tables: a shape each, the views around it."""
    rows = [
        {"category": "car", "method": method, "column": "Pi_g-L", "id": str(i), "view": view, score: value}
        for i, gap in enumerate(gaps)
        for view in range(views)
        for method, value in (("ddf", (5 + gap + 0.1 * (view - (views - 1) / 2)) / factor), ("pc_siren", 5 / factor))
    ]
    return pd.DataFrame(rows)


def _difference(*gaps, **table):
    found = paired.difference([_table(own, **table) for own in gaps], "car", OURS, THEIRS, CHAMFER)
    assert found is not None
    return found


def test_one_training_has_the_error_over_shapes_and_several_add_their_own():
    found = _difference([1.0, 2.0, 3.0, 6.0])
    error = np.std([1, 2, 3, 6], ddof=1) / 2
    assert (found.mean, found.error, found.shapes, found.trainings) == pytest.approx((3.0, error, 4, 1))
    found = _difference([1.0, 2.0, 3.0], [2.0, 3.0, 7.0])
    over_shapes, over_trainings = np.var([1.5, 2.5, 5.0], ddof=1) / 3, np.var([2.0, 4.0], ddof=1) / 2
    assert (found.mean, found.error) == pytest.approx((3.0, np.sqrt(over_shapes + over_trainings)))


@pytest.mark.parametrize(
    ("gaps", "asked"),
    [  # two-sided 95 % of Student's t, as tables print them
        ([[0.0, 1.0, 2.0]], 4.303),
        ([[float(i % 2) for i in range(60)]], 2.001),
        ([[i + j for j in (0.0, 0.001)] for i in (0.0, 1.0, 2.0)], 4.303),  # three trainings that differ: 2 degrees
    ],
)
def test_what_a_claim_asks_is_students_t(gaps, asked):
    found = _difference(*gaps)
    least, most = (dataclasses.replace(found, mean=factor * asked * found.error) for factor in (0.999, 1.001))
    assert most.seen and not least.seen


def test_a_claim_is_rarely_made_where_there_is_no_difference():
    """No difference: shapes, trainings and their interaction vary; at most one in twenty is called one."""
    random, claims = np.random.default_rng(0), 0
    for _ in range(200):
        shapes, trainings = random.normal(size=40), random.normal(size=(3, 1))
        gaps = shapes + 0.1 * trainings + random.normal(size=(3, 40))
        claims += _difference(*gaps, views=1).seen
    assert claims <= 14


@pytest.mark.parametrize(
    ("gaps", "chamfer", "f_score"),
    [
        ([-1.0, -1.2, -0.8, -1.0], 1, -1),
        ([1.0, 1.2, 0.8, 1.0], -1, 1),
        ([1.0, -1.2, 0.8, -1.0], 0, 0),
        ([2.0, 0.0], 0, 0),  # mean 1, standard error 1
        ([-1.0], 0, 0),  # one shape says nothing of its spread
    ],
)
def test_better_follows_the_direction_of_the_metric(gaps, chamfer, f_score):
    assert paired.better(_difference(gaps), CHAMFER) == chamfer
    scored = paired.difference([_table(gaps, score="f_score_tau", factor=100.0)], "car", OURS, THEIRS, F_SCORE)
    assert paired.better(scored, F_SCORE) == f_score


def test_a_method_without_training_is_compared_with_every_training():
    first, second = _table([1.0, 2.0, 3.0]), _table([2.0, 3.0, 7.0])
    found = paired.difference([first, second[second["method"] == "ddf"]], "car", OURS, THEIRS, CHAMFER)
    assert found is not None and found.mean == pytest.approx(3.0) and found.trainings == 2


def test_what_has_no_score_or_other_images_is_no_difference():
    table = _table([1.0, 2.0])
    assert paired.difference([table], "chair", OURS, THEIRS, CHAMFER) is None
    assert paired.better(None, CHAMFER) == 0
    with pytest.raises(checks.InputError, match="not scored on the same images"):
        paired.difference([table.iloc[:-1]], "car", OURS, THEIRS, CHAMFER)
    with pytest.raises(checks.InputError, match="not scored on the same shapes"):
        paired.difference([table, _table([1.0, 2.0, 3.0])], "car", OURS, THEIRS, CHAMFER)

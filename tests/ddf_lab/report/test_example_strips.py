"""Images of the strips: by percentiles of the error and of the difference."""

import pandas as pd
import pytest

from ddf_lab.report import example_strips
from ddf_lab.report.example_strips import Errors

_BOTH = {"a": (1.0, 2.0), "b": (5.0, 2.0), "c": (3.0, 3.0), "d": (2.0, 6.0), "e": (4.0, 2.0)}  # DDF, PC-SIREN
_ERRORS = {(name, 0): Errors(*both, 1.0) for name, both in _BOTH.items()}


def _names(chosen):
    return {image[0]: name for image, name in chosen.items()}


def test_rows_go_from_best_to_worst_and_from_the_clearest_win_to_the_clearest_loss():
    assert _names(example_strips.choose(_ERRORS, 2)) == {
        "a": "smallest error of DDF",
        "b": "largest error of DDF; DDF farthest behind",
        "d": "DDF farthest ahead",
    }
    chosen = _names(example_strips.choose(_ERRORS, 3))
    assert list(chosen) == ["a", "c", "b", "d"]
    assert chosen["c"] == "median error; median difference"
    assert list(_names(example_strips.choose(_ERRORS, 5)).values())[1] == "25 % of the errors; DDF farthest ahead"
    assert set(_names(example_strips.choose(_ERRORS, 20))) == set("abcde")  # fewer than asked for: all, once


@pytest.mark.parametrize(
    ("shift", "first", "last"),
    [(10.0, "DDF least behind", "DDF farthest behind"), (-10.0, "DDF farthest ahead", "DDF least ahead")],
)
def test_a_model_that_always_wins_is_not_said_to_lose(shift, first, last):
    moved = {image: own._replace(ddf=own.ddf + shift) for image, own in _ERRORS.items()}
    chosen = _names(example_strips.choose(moved, 2))
    assert chosen["d"].endswith(first) and chosen["b"].endswith(last)


def test_errors_are_those_at_the_true_camera_with_large_clouds():
    rows = [
        ("ddf", "Pi_g-L", "a", 1, 0.002),
        ("pc_siren", "Pi_g-L", "a", 1, 0.003),
        ("ddf", "Pi_pred-L", "a", 1, 0.5),
        ("ddf_image", "Pi_g-L", "a", 1, 0.001),
        ("ddf_nh1", "Pi_g-L", "a", 1, 0.7),
    ]
    table = pd.DataFrame(rows, columns=["method", "column", "id", "view", "chamfer_l2_sq"])
    errors = example_strips.image_errors(table)
    assert errors == {("a", 1): pytest.approx(Errors(2.0, 3.0, 1.0))}
    assert Errors(2.0, 3.0, 1.0).words() == "D_C × 1000: DDF 2.000, PC-SIREN 3.000, DDF+image 1.000"

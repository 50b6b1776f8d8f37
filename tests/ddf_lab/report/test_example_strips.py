"""Images of the strips: by percentiles of the error."""

import pandas as pd
import pytest

from ddf_lab.report import example_strips

_BOTH = {"a": (1.0, 2.0), "b": (5.0, 2.0), "c": (3.0, 3.0), "d": (2.0, 6.0), "e": (4.0, 2.0)}  # DDF, PC-SIREN
_ERRORS = {(name, 0): {"ddf": ours, "pc_siren": theirs} for name, (ours, theirs) in _BOTH.items()}


def _names(chosen):
    return {image[0]: name for image, name in chosen.items()}


def test_rows_go_from_best_to_worst():
    assert _names(example_strips.choose(_ERRORS, 2)) == {"a": "smallest error of DDF", "b": "largest error of DDF"}
    assert list(_names(example_strips.choose(_ERRORS, 3))) == ["a", "c", "b"]
    assert list(_names(example_strips.choose(_ERRORS, 5)).values())[1] == "25 % of the errors of DDF"
    assert set(_names(example_strips.choose(_ERRORS, 20))) == set("abcde")  # fewer than asked for: all


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
    assert errors == {("a", 1): pytest.approx({"ddf": 2.0, "pc_siren": 3.0, "ddf_image": 1.0})}
    assert example_strips.words(errors["a", 1]) == "D_C × 1000: DDF 2.000, PC-SIREN 3.000, DDF+image 1.000"

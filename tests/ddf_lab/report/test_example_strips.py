"""Images of the strips: by percentiles of the error."""

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

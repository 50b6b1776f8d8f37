"""Results as people read them and as scripts do: what is not known is "–" and null."""

import json
import math

import numpy as np
import pytest

from ddf.cli import results


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, "–"),
        (np.float32("nan"), "–"),
        (math.inf, "inf"),
        (True, "yes"),
        (np.bool_(False), "no"),
        (4812, "4,812"),
        (0.0123456, "0.01235"),
        (123456.7, "123,457"),
        (0.0, "0"),
        ([1, math.nan], "1, –"),
        ([], "none"),
        (list(range(9)), "9 in all"),
        ("a", "a"),
    ],
)
def test_cells(value, shown):
    assert results.cell(value) == shown


def test_nothing_known_is_null_in_json_and_a_dash_in_text():
    result = {"mean": math.nan, "far": [math.inf, 1.0], "array": np.array([np.nan, 2.0]), "verdict": "v", "table": {}}
    assert json.loads(results.json_line(result)) == {"mean": None, "far": [None, 1.0], "array": [None, 2.0]}
    assert results.text({"mean": math.nan, "of": {"x": None}}) == "mean  –\nof.x  –\n"

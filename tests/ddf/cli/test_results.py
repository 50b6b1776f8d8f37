"""Results as people read them and as scripts do: what is not known is "–" and null."""

import json
import math

import numpy as np

from ddf.cli import results


def test_nothing_known_is_null_in_json_and_a_dash_in_text():
    result = {"mean": math.nan, "far": [math.inf, 1.0], "array": np.array([np.nan, 2.0]), "verdict": "v", "table": {}}
    assert json.loads(results.json_line(result)) == {"mean": None, "far": [None, 1.0], "array": [None, 2.0]}
    assert results.text({"mean": math.nan, "of": {"x": None}}) == "mean  –\nof.x  –\n"

"""What the benchmarks wrote: frontier, spread, damaged files."""

import json

import numpy as np
import pytest

from bench.lib import results
from ddf.core import checks


def test_frontier_is_what_no_other_point_beats_in_both():
    points = [tuple(point) for point in np.random.default_rng(0).integers(0, 12, (60, 2)).tolist()]
    found = results.frontier(points)
    for i, point in enumerate(points):
        beaten = any(o != point and o[0] <= point[0] and o[1] <= point[1] for o in points)
        assert (point in [points[k] for k in found]) != beaten
        assert found.count(i) <= 1
    assert [points[i] for i in found] == sorted({points[i] for i in found})
    assert results.frontier([(1.0, 2.0), (1.0, 2.0)]) == [0]


def test_spread_holds_the_medians_of_second_runs():
    rng = np.random.default_rng(0)
    for noise, samples in ((0.02, 21), (0.1, 5), (0.1, 1), (0.3, 21)):
        drifts = rng.normal(0, results.DRIFT, (2, 2000, 1))
        runs = np.exp(drifts + rng.normal(0, noise, (2, 2000, samples)))
        low, middle, high = np.quantile(runs, (0.25, 0.5, 0.75), axis=-1)
        spreads = [
            [
                results.spread(results.Row("a", {}, (q1, q2, q3), {}, samples=samples))
                for q1, q2, q3 in zip(*run, strict=True)
            ]
            for run in zip(low, middle, high, strict=True)
        ]
        outside = np.abs(np.log(middle[1] / middle[0])) > np.log(np.max(spreads, axis=0))
        assert outside.mean() < 0.015, (noise, samples)


def test_spread_narrows_with_samples_and_widens_with_quartiles():
    def spread(low, high, samples):
        return results.spread(results.Row("a", {}, (low, 1.0, high), {}, samples=samples))

    assert spread(0.9, 1.1, 5) > spread(0.9, 1.1, 50) > np.exp(results.CERTAINTY * results.DRIFT)
    assert spread(0.7, 1.4, 5) > spread(0.9, 1.1, 5) > spread(1.0, 1.0, 5)
    assert results.spread(results.Row("a", {}, None, {})) == 1.0


@pytest.mark.parametrize("entry", [{}, {"what": "a", "size": {}, "error": {}, "median_s": 1.0, "quartiles_s": [2, 3]}])
def test_damaged_results_are_refused_by_name(tmp_path, entry):
    record = {"benchmark": "x", "cpu": "", "cores": 1, "threads": 1, "versions": {}, "rows": [entry]}
    (tmp_path / "x.json").write_text(json.dumps(record))
    with pytest.raises(checks.InputError, match=r"x\.json: not the result of a benchmark"):
        results.load_folder(tmp_path)
    with pytest.raises(checks.InputError, match="holds no results"):
        results.load_folder(tmp_path / "absent")

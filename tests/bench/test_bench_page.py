"""The page of the benchmarks: lines, pictures, notes; the frontier; damaged files."""

import json

import numpy as np
import pytest

from bench.lib import page
from ddf.core import checks
from ddf_lab.report import pages


def _benchmark(*errors, name="training_step"):
    rows = [page.Row(f"way {i}", {"hidden": [8], "n": i}, 1e-2 * 2**i, error) for i, error in enumerate(errors)]
    return page.Benchmark(name, "a CPU, 2 cores", rows)


def test_page_has_a_line_per_row_and_a_picture_where_there_is_an_error():
    found = {"training_step": _benchmark(*({"gradient_relative": error} for error in (0.0, 1e-6, 1e-6)))}
    text = pages.markdown(made := page.page(found))
    (picture,) = made.contents().items()
    assert picture[0] == "training_step.png" and picture[1].startswith(b"\x89PNG")
    assert "![training step: time against relative error of the gradient](training_step.png)" in text
    assert text.count("| way ") == 3 and "a CPU, 2 cores" in text and "| way 1 | 1 | 20 | 1e-06 |" in text
    assert page.page(found).contents() == made.contents()
    made = page.page({"training_step": _benchmark({}, {})})  # without an error to draw
    assert made.contents() == {} and pages.markdown(made).count("| way ") == 2


def test_page_of_many_rows_shows_the_frontier_and_says_so():
    rows = [{"gradient_relative": 1e-3 / 10**i if i < 3 else 1e-3} for i in range(page.MOST_ROWS + 5)]
    text = pages.markdown(page.page({"training_step": _benchmark(*rows)}))
    assert text.count("| way ") == 3 and f"3 of {len(rows)} lines; all: [training_step.json]" in text


def test_frontier_is_what_no_other_point_beats_in_both():
    points = [tuple(point) for point in np.random.default_rng(0).integers(0, 12, (60, 2)).tolist()]
    found = page.frontier(points)
    for i, point in enumerate(points):
        beaten = any(o != point and o[0] <= point[0] and o[1] <= point[1] for o in points)
        assert (point in [points[k] for k in found]) != beaten
        assert found.count(i) <= 1
    assert [points[i] for i in found] == sorted({points[i] for i in found})
    assert page.frontier([(1.0, 2.0), (1.0, 2.0)]) == [0]


@pytest.mark.parametrize("entry", [{}, {"what": "a", "size": {}, "error": {}, "median_s": 1.0, "quartiles_s": [2, 3]}])
def test_damaged_results_are_refused_by_name(tmp_path, entry):
    record = {"benchmark": "x", "cpu": "", "cores": 1, "threads": 1, "versions": {}, "rows": [entry], "took_s": 1}
    (tmp_path / "x.json").write_text(json.dumps(record))
    with pytest.raises(checks.InputError, match=r"x\.json: not the result of a benchmark"):
        page.load_folder(tmp_path)
    with pytest.raises(checks.InputError, match="holds no results"):
        page.load_folder(tmp_path / "absent")

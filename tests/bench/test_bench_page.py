"""The page of the benchmarks: lines, pictures, notes; the frontier; damaged files."""

import dataclasses
import json

import numpy as np
import pytest

from bench.fields import field_inference
from bench.lib import page, pareto, results
from ddf.core import checks
from ddf_lab.report import pages


def _benchmark(*errors, name="training_step"):
    rows = [
        results.Row(f"way {i}", {"hidden": [8], "n": i}, (9e-3 * 2**i, 1e-2 * 2**i, 1.1e-2 * 2**i), error)
        for i, error in enumerate(errors)
    ]
    return results.Benchmark(name, "a CPU", 2, 2, {"torch": "2"}, rows, 3.0)


def test_page_has_a_line_per_row_and_a_picture_where_there_is_an_error():
    found = {"training_step": _benchmark(*({"gradient_relative": error} for error in (0.0, 1e-6, 1e-6)))}
    text = pages.markdown(made := page.page(found))
    (picture,) = made.contents().items()
    assert picture[0] == "training_step.png" and picture[1].startswith(b"\x89PNG")
    assert "![training step: time against relative error of the gradient](training_step.png)" in text
    assert text.count("| way ") == 3 and "a CPU, 2 cores, threads: 2; torch 2; 3 s in all." in text
    assert "| 2 | way 1 | 1 | 20 | 18 – 22 | 1e-06 |" in text
    assert page.page(found).contents() == made.contents()


def test_page_without_an_error_to_draw_is_a_table():
    made = page.page({"training_step": _benchmark({}, {})})
    assert made.contents() == {} and pages.markdown(made).count("| way ") == 2


def test_note_compares_the_runtimes_in_float32():
    kinds = (("torch", 0.2), ("torch.compile", 0.1), ("onnxruntime", 0.12), ("onnxruntime", 0.11))
    size = {"width": 128, "outputs": ["visibility", "depth"]}
    rows = [results.Row("", size, (t, t, t), {}, {"runtime": name, "precision": "float32"}) for name, t in kinds]
    rows.append(results.Row("", size, (0.01, 0.01, 0.01), {}, {"runtime": "onnxruntime", "precision": "int8"}))
    note = field_inference.sentence(dataclasses.replace(_benchmark(), rows=rows)) or ""
    assert note.endswith("float32: depth, width 128: 1.1.")


def test_pictures_take_exact_and_equal_points():
    points = [pareto.Point(1, "a", 0.1, 0.0), pareto.Point(2, "b", 0.1, 0.0), pareto.Point(3, "c", 0.01, 0.5)]
    panels = [pareto.Panel("one", "error", points)] * 4
    assert pareto.draw(panels) == pareto.draw(panels)


def test_frontier_is_what_no_other_point_beats_in_both():
    points = [tuple(point) for point in np.random.default_rng(0).integers(0, 12, (60, 2)).tolist()]
    found = results.frontier(points)
    for i, point in enumerate(points):
        beaten = any(o != point and o[0] <= point[0] and o[1] <= point[1] for o in points)
        assert (point in [points[k] for k in found]) != beaten
        assert found.count(i) <= 1
    assert [points[i] for i in found] == sorted({points[i] for i in found})
    assert results.frontier([(1.0, 2.0), (1.0, 2.0)]) == [0]


@pytest.mark.parametrize("entry", [{}, {"what": "a", "size": {}, "error": {}, "median_s": 1.0, "quartiles_s": [2, 3]}])
def test_damaged_results_are_refused_by_name(tmp_path, entry):
    record = {"benchmark": "x", "cpu": "", "cores": 1, "threads": 1, "versions": {}, "rows": [entry], "took_s": 1}
    (tmp_path / "x.json").write_text(json.dumps(record))
    with pytest.raises(checks.InputError, match=r"x\.json: not the result of a benchmark"):
        results.load_folder(tmp_path)
    with pytest.raises(checks.InputError, match="holds no results"):
        results.load_folder(tmp_path / "absent")

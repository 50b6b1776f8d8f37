"""What the benchmarks write and how it is read: frontier, spread, two runs compared, the page and its pictures."""

import dataclasses
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bench import _measure, _page, _pareto, _results
from ddf.core import checks
from ddf.report import pages

ROOT = Path(__file__).resolve().parents[2]
TIMES = (0.010, 0.020, 0.040)


def _benchmark(name="training_step", factor=1.0, **changes):
    rows = [
        _results.Row(
            f"way {i}",
            {"hidden": [8], "n": i},
            (0.9 * t * factor, t * factor, 1.1 * t * factor),
            {"off": e},
            samples=21,
        )
        for i, (t, e) in enumerate(zip(TIMES, (0.3, 0.2, 0.1), strict=True))
    ]
    return _results.Benchmark(
        name, "a CPU", 2, 2, {"torch": "2"}, [dataclasses.replace(row, **changes) for row in rows]
    )


def _changed(benchmark, index, **changes):
    rows = list(benchmark.rows)
    rows[index] = dataclasses.replace(rows[index], **changes)
    return dataclasses.replace(benchmark, rows=rows)


def test_frontier_is_what_no_other_point_beats_in_both():
    points = [tuple(point) for point in np.random.default_rng(0).integers(0, 12, (60, 2)).tolist()]
    found = _results.frontier(points)
    for i, point in enumerate(points):
        beaten = any(o != point and o[0] <= point[0] and o[1] <= point[1] for o in points)
        assert (point in [points[k] for k in found]) != beaten
        assert found.count(i) <= 1
    assert [points[i] for i in found] == sorted({points[i] for i in found})
    assert _results.frontier([(1.0, 2.0), (1.0, 2.0)]) == [0]


class _Clock:
    """Stands still but for what candidates take."""

    def __init__(self):
        self.now, self.calls = 0.0, {}

    def candidate(self, name, *seconds):
        def work():
            taken = self.calls[name] = self.calls.get(name, 0) + 1
            self.now += seconds[min(taken, len(seconds)) - 1]

        return work


@pytest.fixture
def _clock(monkeypatch):
    clock = _Clock()
    monkeypatch.setattr(_measure.time, "perf_counter", lambda: clock.now)
    return clock


def test_a_sample_of_what_is_fast_is_the_mean_of_calls(_clock):
    tick, alternating = _measure.TICK, (1.0, 2.0) * 100
    fast = _clock.candidate("fast", *(seconds * tick / 3 for seconds in alternating))
    (times,) = _measure.interleaved({"fast": fast}, 7).values()
    # The second call says how many make a sample: two here, one of either length.
    assert times == pytest.approx([1.5 * tick / 3] * len(times)) and len(times) == _measure.LEAST
    assert _clock.calls["fast"] == 2 + 2 * _measure.LEAST


def test_candidates_take_turns_and_slow_ones_leave(_clock):
    order, rough = [], (0.2, 0.2, 0.3, 0.4, 0.7) * 9
    ways = {"slow": _clock.candidate("slow", _measure.WARM), "rough": _clock.candidate("rough", *rough)}
    told = {name: (lambda name=name, way=way: (order.append(name), way())) for name, way in ways.items()}
    times = _measure.interleaved(told, 9, seconds=1.5 * _measure.WARM)
    assert times["slow"] == pytest.approx([_measure.WARM] * 2)  # its first call is a sample; it leaves after the second
    assert order == ["slow", "rough", "slow", *["rough"] * len(times["rough"])]
    assert sum(times["rough"][:-1]) < 1.5 * _measure.WARM <= sum(times["rough"])
    assert len(_measure.interleaved({"rough": _clock.candidate("again", *rough)}, 3)["rough"]) == 3


def test_spread_holds_the_medians_of_second_runs():
    rng = np.random.default_rng(0)
    for noise, samples in ((0.02, 21), (0.1, 5), (0.1, 1), (0.3, 21)):
        drifts = rng.normal(0, _results.DRIFT, (2, 2000, 1))
        runs = np.exp(drifts + rng.normal(0, noise, (2, 2000, samples)))
        low, middle, high = np.quantile(runs, (0.25, 0.5, 0.75), axis=-1)
        spreads = [
            [
                _results.spread(_results.Row("a", {}, (q1, q2, q3), {}, samples=samples))
                for q1, q2, q3 in zip(*run, strict=True)
            ]
            for run in zip(low, middle, high, strict=True)
        ]
        outside = np.abs(np.log(middle[1] / middle[0])) > np.log(np.max(spreads, axis=0))
        assert outside.mean() < 0.015, (noise, samples)


def test_spread_narrows_with_samples_and_widens_with_quartiles():
    def spread(low, high, samples):
        return _results.spread(_results.Row("a", {}, (low, 1.0, high), {}, samples=samples))

    assert spread(0.9, 1.1, 5) > spread(0.9, 1.1, 50) > np.exp(_results.CERTAINTY * _results.DRIFT)
    assert spread(0.7, 1.4, 5) > spread(0.9, 1.1, 5) > spread(1.0, 1.0, 5)
    assert _results.spread(_results.Row("a", {}, None, {})) == 1.0


def test_rows_are_read_as_they_are_written(tmp_path, monkeypatch):
    monkeypatch.setattr(_measure, "OUT", tmp_path)
    timed = _measure.row("a", {"n": 5}, [3.0, 1.0, 2.0, 5.0, 4.0], {"off": 0.1}, error_tolerance=0.02)
    _measure.write(
        "x", 2, [{**timed, "rate": 7}, _measure.row("b", {}, [0.5], {}), {"what": "c", "size": {}, "error": {}}]
    )
    found = _results.load_folder(tmp_path)["x"]
    assert [row.seconds for row in found.rows] == [(2.0, 3.0, 4.0), (0.5, 0.5, 0.5), None]
    assert found.rows[0].told == {"error_tolerance": 0.02, "rate": 7} and found.rows[0].error == {"off": 0.1}
    assert [row.samples for row in found.rows] == [5, 1, 1]
    assert found.took_s is not None and found.took_s >= 0
    assert found.threads == 2 and set(found.versions) == set(_measure.PACKAGES)


@pytest.mark.parametrize("entry", [{}, {"what": "a", "size": {}, "error": {}, "median_s": 1.0, "quartiles_s": [2, 3]}])
def test_damaged_results_are_refused_by_name(tmp_path, entry):
    record = {"benchmark": "x", "cpu": "", "cores": 1, "threads": 1, "versions": {}, "rows": [entry]}
    (tmp_path / "x.json").write_text(json.dumps(record))
    with pytest.raises(checks.InputError, match=r"x\.json: not the result of a benchmark"):
        _results.load_folder(tmp_path)
    with pytest.raises(checks.InputError, match="holds no results"):
        _results.load_folder(tmp_path / "absent")


@pytest.mark.parametrize("factor", [1.0, 1.2, 3.0, 0.3])
def test_a_machine_that_is_slower_as_a_whole_agrees(factor):
    found = _results.compare(_benchmark(), _benchmark(factor=factor))
    assert found.faults == [] and found.factor == pytest.approx(factor) and found.rows == 3


def test_one_row_that_is_slower_by_itself_is_told():
    slow = _changed(_benchmark(), 1, seconds=(0.035, 0.036, 0.037))
    (fault,) = _results.compare(_benchmark(), slow).faults
    assert fault.startswith("way 1, hidden [8], n 1: 20 ms, then 36 ms") and "1.80" in fault
    wide = _changed(_benchmark(), 1, seconds=(0.010, 0.020, 0.035))
    assert _results.compare(wide, slow).faults == []


def test_too_few_rows_have_no_common_factor():
    one, other = (dataclasses.replace(run, rows=run.rows[:2]) for run in (_benchmark(), _benchmark(factor=3.0)))
    assert len(_results.compare(one, other).faults) == 2


@pytest.mark.parametrize(
    "first, second, told, equal",
    [
        ({"off": 0.2}, {"off": 0.201}, {}, False),
        ({"off": 0.2}, {"off": 0.201}, {"error_tolerance": 0.01}, True),
        ({"off": 0.0}, {"off": 1e-12}, {}, False),
        ({"off": 3e-7}, {"off": 4e-7}, {}, True),
        ({"off": 3e-7}, {"off": 7e-7}, {}, False),
        ({"off": float("nan")}, {"off": float("nan")}, {}, True),
        ({"off": float("nan")}, {"off": 0.2}, {}, False),
        ({"off": 0.2}, {"on": 0.2}, {}, False),
    ],
)
def test_errors_must_be_equal_or_within_what_the_row_says(first, second, told, equal):
    one = _changed(_benchmark(), 0, error=first, told=told)
    found = _results.compare(one, _changed(_benchmark(), 0, error=second, told=told))
    assert (found.faults == []) == equal


def test_rows_of_one_run_only_are_told():
    short = dataclasses.replace(_benchmark(), rows=_benchmark().rows[1:])
    assert _results.compare(_benchmark(), short).faults == ["way 0, hidden [8], n 0: not in the second run"]
    assert _results.compare(short, _benchmark()).faults == ["way 0, hidden [8], n 0: not in the first run"]


@pytest.mark.parametrize("change, code, said", [(1.0, 0, "agrees"), (5.0, 1, "1 rows or errors differ")])
def test_compare_ends_with_one_where_runs_differ(tmp_path, monkeypatch, change, code, said):
    for folder, factor in (("a", 1.0), ("b", change)):
        monkeypatch.setattr(_measure, "OUT", tmp_path / folder)
        times = [0.01 * factor, 0.02, 0.03]
        _measure.write("x", 1, [_measure.row(str(i), {}, [t], {}) for i, t in enumerate(times)])
    program = [sys.executable, ROOT / "bench" / "_compare.py", tmp_path / "a", tmp_path / "b"]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    assert done.returncode == code and said in done.stdout


def test_page_has_a_line_per_row_and_a_picture_where_there_is_an_error():
    found = {
        "training_step": _changed(_benchmark(error={"gradient_relative": 1e-6}), 0, error={"gradient_relative": 0.0})
    }
    text = pages.markdown(made := _page.page(found))
    assert list(made.files) == ["training_step_pareto.png"]
    assert made.files["training_step_pareto.png"].startswith(b"\x89PNG")
    assert "![training step: ms against" in text and "What matters most" not in text
    assert text.count("| way ") == 3 and "a CPU, 2 cores, 2 threads; torch 2." in text
    assert "| 2 | way 1 | 1 | 20 | 18 – 22 | 1.40 | 1e-06 |" in text
    assert _page.page(found).files == made.files


@pytest.mark.parametrize("error", [{}, {"gradient_relative": 0.0}])
def test_page_without_an_error_to_draw_is_a_table(error):
    made = _page.page({"training_step": _benchmark(error=error)})
    assert made.files == {} and pages.markdown(made).count("| way ") == 3


def test_what_a_benchmark_drew_itself_is_shown():
    assert "(training_step.png)" in pages.markdown(_page.page({"training_step": _benchmark()}, ["training_step.png"]))


def test_pages_of_their_own_share_a_line():
    found = {name: _benchmark(name) for name in ("fit_curves", "growth", "primitive_fits", "training_step")}
    (line,) = _page.page(found).lead[1:]
    assert (
        line == "On pages of their own: [fit curves, primitive fits](../fit_proof/README.md); [growth](../growth.md)."
    )
    assert len(_page.page({"training_step": _benchmark()}).lead) == 1


def test_clouds_come_first_with_measured_figures():
    def row(category, directions, cycles, seconds, score):
        size = {"num_directions": directions, "cycles": cycles, "jitter": 0.0, "points": 5000}
        return _results.Row(category, size, (seconds,) * 3, {"f_score_tau_x100": score})

    grid = [(4, 1, 1.0, 40.0), (48, 3, 4.0, 70.0), (128, 3, 16.0, 66.0)]
    rows = [row(category, n, h, t, f + up) for category, up in (("chair", 0), ("car", 10)) for n, h, t, f in grid]
    clouds = dataclasses.replace(_benchmark("cloud_sampling"), rows=rows)
    made = _page.page({"cloud_sampling": clouds, "training_step": _benchmark()})
    sentences, picture = made.sections[0].blocks[:2]
    assert isinstance(sentences, tuple) and isinstance(picture, pages.Figure)
    (sentence,) = sentences
    assert "of 3 settings 2 are on the frontier, from 4 directions and 1 cycle (1 s, F(τ) × 100 = 45.0)" in sentence
    assert "48 directions and 3 cycles (4 s, F(τ) × 100 = 75.0)" in sentence
    assert "the paper's way is 128 directions and 3 cycles (16 s, F(τ) × 100 = 71.0)" in sentence
    assert picture.name == "cloud_sampling_pareto.png"
    assert pages.markdown(made).count("](cloud_sampling_pareto.png)") == 1


def test_rendering_names_the_fastest_tracing_that_is_as_good():
    """Every pixel against every pixel; the refined DDF against refined tracing too."""

    def row(what, seconds, median, wrong=0.01):
        error = {"depth_median": median, "wrong_visibility": wrong}
        told = {"times_ddf": seconds / 0.1}
        return _results.Row(what, {"pixels_a_side": 256}, (seconds,) * 3, error, told)

    def sentence(*more):
        return _page.rendering_sentence(dataclasses.replace(_benchmark(), rows=[*rows, *more])) or ""

    rows = [row("DDF", 0.1, 0.01), row("sphere tracing, 8 steps", 0.5, 0.02), row("mesh casting", 0.05, 1e-7)]
    told = sentence(row("sphere tracing, 9 steps", 0.4, 0.005, wrong=0.02))
    assert "no sphere tracing of a network of the same size as good, nearest sphere tracing, 9 steps" in told
    rows += [row("sphere tracing, 64 steps", 1.5, 0.009), row("sphere tracing, 64 steps, refined", 0.8, 0.009)]
    first = "the fastest tracing as good, sphere tracing, 64 steps (1,500 ms, median error of depth 0.009), 15 times"
    assert first in sentence()
    rows.append(row("DDF, refined", 0.05, 0.011))
    told = sentence()
    assert first in told and told.endswith("; mesh casting (50 ms, median error of depth 1e-07).")
    assert "; DDF, refined (50 ms, median error of depth 0.011), the fastest tracing as good, " in told
    assert "sphere tracing, 64 steps, refined (800 ms, median error of depth 0.009), 16 times as long" in told


def test_notes_hold_measured_times_against_their_goals():
    def row(what, size, seconds, **told):
        return _results.Row(what, size, (seconds,) * 3, {}, told)

    shape = {"shape": "cube", "counts": "cpu", "threads": 1}
    rows = [row("Open3D alone, scene built", shape, 0.01), row("samples, file written", shape, 0.023)]
    note = _page.extraction_note(dataclasses.replace(_benchmark("sample_extraction"), rows=rows)) or ""
    assert "its scene built: on 1 core cube (cpu) 2.3. The goal is at most 2." in note
    assert _page.extraction_note(dataclasses.replace(_benchmark(), rows=rows[:1])) is None

    size = {"width": 128, "outputs": ["visibility", "depth"]}
    kinds = (("torch", 0.2), ("torch.compile", 0.1), ("onnxruntime", 0.12), ("onnxruntime", 0.11))
    rows = [row("", size, seconds, runtime=runtime, precision="float32") for runtime, seconds in kinds]
    rows.append(row("", size, 0.01, runtime="onnxruntime", precision="int8"))
    note = _page.runtimes_note(dataclasses.replace(_benchmark("field_inference"), rows=rows)) or ""
    assert "two threads: visibility and depth: 1.1 (width 128). The goal is at most 1." in note


def test_pictures_take_exact_and_equal_points():
    points = [_pareto.Point(1, "a", 0.1, 0.0), _pareto.Point(2, "b", 0.1, 0.0), _pareto.Point(3, "c", 0.01, 0.5)]
    panels = [_pareto.Panel("one", "error", "ms", points)] * 4
    assert _pareto.draw(panels) == _pareto.draw(panels)

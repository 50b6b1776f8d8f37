"""Two runs of a benchmark compared."""

import dataclasses
import subprocess
import sys
from pathlib import Path

import pytest
from _benchmarks import benchmark, changed

from bench.lib import compare, measuring

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("factor", [1.0, 1.2, 3.0, 0.3])
def test_a_machine_that_is_slower_as_a_whole_agrees(factor):
    found = compare.compare(benchmark(), benchmark(factor=factor))
    assert found.faults == [] and found.factor == pytest.approx(factor) and found.rows == 3


def test_one_row_that_is_slower_by_itself_is_told():
    slow = changed(benchmark(), 1, seconds=(0.035, 0.036, 0.037))
    (fault,) = compare.compare(benchmark(), slow).faults
    assert fault.startswith("way 1, hidden [8], n 1: 20 ms, then 36 ms") and "1.80" in fault
    wide = changed(benchmark(), 1, seconds=(0.010, 0.020, 0.035))
    assert compare.compare(wide, slow).faults == []


def test_too_few_rows_have_no_common_factor():
    one, other = (dataclasses.replace(run, rows=run.rows[:2]) for run in (benchmark(), benchmark(factor=3.0)))
    assert len(compare.compare(one, other).faults) == 2


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
    one = changed(benchmark(), 0, error=first, told=told)
    found = compare.compare(one, changed(benchmark(), 0, error=second, told=told))
    assert (found.faults == []) == equal


def test_rows_of_one_run_only_are_told():
    short = dataclasses.replace(benchmark(), rows=benchmark().rows[1:])
    assert compare.compare(benchmark(), short).faults == ["way 0, hidden [8], n 0: not in the second run"]
    assert compare.compare(short, benchmark()).faults == ["way 0, hidden [8], n 0: not in the first run"]


@pytest.mark.parametrize("change, code, said", [(1.0, 0, "agrees"), (5.0, 1, "1 rows or errors differ")])
def test_compare_ends_with_one_where_runs_differ(tmp_path, monkeypatch, change, code, said):
    for folder, factor in (("a", 1.0), ("b", change)):
        monkeypatch.setattr(measuring, "OUT", tmp_path / folder)
        times = [0.01 * factor, 0.02, 0.03]
        measuring.write("x", 1, [measuring.row(str(i), {}, [t], {}) for i, t in enumerate(times)])
    program = [sys.executable, "-m", "bench", "compare", tmp_path / "a", tmp_path / "b"]
    done = subprocess.run(program, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == code and said in done.stdout

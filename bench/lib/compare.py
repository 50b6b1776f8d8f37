"""Two runs of the benchmarks compared: `python -m bench compare FIRST_DIR SECOND_DIR` ends with 1 where they differ.

A second run agrees when its median is within the spread of the first one's (`results.spread`), the larger of both rows'
spreads; or when it is after the factor by which all rows of that benchmark moved together (the median of their ratios)
is taken off: a busier or a slower machine moves them all. Errors must be equal, or as near as the row says
(`error_tolerance`); errors that are rounding itself, within a factor of 2. Benchmarks that only one folder holds are
named and left out.
"""

import argparse
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.lib import results
from ddf.core import checks

EQUAL = 1e-6  # relative difference at which errors count as equal: sums over threads may be ordered anew
ROUNDING = 1e-5  # errors below this are rounding itself, which depends on how work was split over threads
SHARED_ROWS = 3  # from so many rows on their common factor can be told from their own


@dataclass(frozen=True)
class Comparison:
    """Two runs of one benchmark. factor: by which the second took longer as a whole; faults: one line each."""

    name: str
    rows: int
    factor: float
    faults: list[str]


def compare(first: results.Benchmark, second: results.Benchmark) -> Comparison:
    """Whether the second run says what the first said, row by row (module docstring)."""
    mine, theirs = ({row.key: row for row in run.rows} for run in (first, second))
    faults = [f"{mine[key].label}: not in the second run" for key in mine if key not in theirs]
    faults += [f"{theirs[key].label}: not in the first run" for key in theirs if key not in mine]
    pairs = [(mine[key], theirs[key]) for key in mine if key in theirs]
    ratios = [b.seconds[1] / a.seconds[1] for a, b in pairs if a.seconds and b.seconds]
    factor = statistics.median(ratios) if ratios else 1.0
    for a, b in pairs:
        faults += _error_faults(a, b) + _time_faults(a, b, factor if len(ratios) >= SHARED_ROWS else 1.0)
    return Comparison(first.name, len(pairs), factor, faults)


def _error_faults(first: results.Row, second: results.Row) -> list[str]:
    if first.error.keys() != second.error.keys():
        return [f"{first.label}: errors {', '.join(first.error)} against {', '.join(second.error)}"]
    faults = []
    tolerance = max(EQUAL, float(first.told.get("error_tolerance", 0.0)))
    for name, value in first.error.items():
        other = second.error[name]
        larger = max(abs(value), abs(other))
        allowed = max(tolerance, 0.5 if larger < ROUNDING else 0.0)
        both_missing = math.isnan(value) and math.isnan(other)
        if not (both_missing or value == other or abs(value - other) <= allowed * larger):
            faults.append(f"{first.label}: {name} {value:.6g}, then {other:.6g}")
    return faults


def _time_faults(first: results.Row, second: results.Row, shared: float) -> list[str]:
    if first.seconds is None or second.seconds is None:
        missing = (first.seconds is None) != (second.seconds is None)
        return [f"{first.label}: timed in one run only"] if missing else []
    ratio, allowed = second.seconds[1] / first.seconds[1], max(results.spread(first), results.spread(second))
    off = min(abs(math.log(ratio)), abs(math.log(ratio / shared)))
    if off <= math.log(allowed):
        return []
    times = f"{1e3 * first.seconds[1]:.4g} ms, then {1e3 * second.seconds[1]:.4g} ms"
    return [f"{first.label}: {times}: a factor of {math.exp(off):.2f} besides the common one, stated {allowed:.2f}"]


def run(arguments: Sequence[str]) -> int:
    """Print one line per benchmark, and one per row that is outside its spread or has another error; 1 for any."""
    parser = argparse.ArgumentParser("python -m bench compare", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("first", type=Path, help="a folder of results")
    parser.add_argument("second", type=Path, help="another")
    given = parser.parse_args(arguments)
    first, second = results.load_folder(given.first), results.load_folder(given.second)
    alone = sorted(first.keys() ^ second.keys())
    if alone:
        print(f"in one folder only: {', '.join(alone)}")
    if not first.keys() & second.keys():
        raise checks.InputError(f"{given.first} and {given.second} have no benchmark in common")
    faults = 0
    for name in sorted(first.keys() & second.keys()):
        found = compare(first[name], second[name])
        faults += len(found.faults)
        verdict = "agrees" if not found.faults else f"{len(found.faults)} rows or errors differ"
        print(f"{name}: {found.rows} rows, second run x {found.factor:.2f}, {verdict}")
        for fault in found.faults:
            print(f"  {fault}")
    return 1 if faults else 0

"""What the benchmarks wrote: rows, how far a median may move in a second run, the frontier, two runs compared.

Spread of a row: the factor within which a second run's median lies, but for one row of a hundred. The difference of
two medians of logarithms has the variance 2 (drift² + π/2 σ²/n). σ, of one sample, is what the quartiles show, widened
by 1 + 2/n, as those of few samples are close together, and no less than `LEAST_NOISE`; n is the number of samples;
`DRIFT` is what a run's own quartiles cannot show: other users, clocks and memory differ from one minute to another. A
second run agrees when its median is within that factor of the first one's, the larger of both rows' factors; or when it
is after the factor by which all rows of that benchmark moved together (the median of their ratios) is taken off: a
busier or a slower machine moves them all. Errors must be equal, or as near as the row says (`error_tolerance`); errors
that are rounding itself, within a factor of 2.
"""

import json
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ddf.core import checks

DRIFT = 0.08  # standard deviation of a median's logarithm from run to run, on a machine that others use too
LEAST_NOISE = 0.10  # σ is taken to be no less: the quartiles of few samples are close together by chance
QUARTILES = 1.349  # distance of a normal distribution's quartiles, in standard deviations
CERTAINTY = 2.6  # standard deviations: 99 % of normal differences
EQUAL = 1e-6  # relative difference at which errors count as equal: sums over threads may be ordered anew
ROUNDING = 1e-5  # errors below this are rounding itself, which depends on how work was split over threads
SHARED_ROWS = 3  # from so many rows on their common factor can be told from their own


@dataclass(frozen=True)
class Row:
    """One line.

    seconds: (q1, median, q3) of `samples` samples, or None where only the error was measured. told: everything else.
    """

    what: str
    size: dict[str, Any]
    seconds: tuple[float, float, float] | None
    error: dict[str, float]
    told: dict[str, Any] = field(default_factory=dict)
    samples: int = 1

    @property
    def key(self) -> str:
        """What a row is called in both runs."""
        return json.dumps([self.what, self.size], sort_keys=True)

    @property
    def label(self) -> str:
        """The key, for people."""
        return ", ".join([self.what, *(f"{name} {value}" for name, value in self.size.items())])


@dataclass(frozen=True)
class Benchmark:
    """A file of rows and where they were measured. took_s: seconds of the whole script, None where unknown."""

    name: str
    cpu: str
    cores: int
    threads: int
    versions: dict[str, str]
    rows: list[Row]
    took_s: float | None = None


def load(file: Path) -> Benchmark:
    """The rows of one file.

    Raises:
      InputError: it is not such a file, or a row lacks something; named.
    """
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        rows = [_row(entry) for entry in record["rows"]]
        machine = (record["cpu"], record["cores"], record["threads"], record["versions"])
        return Benchmark(record["benchmark"], *machine, rows, record.get("took_s"))
    except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
        raise checks.InputError(f"{file}: not the result of a benchmark ({type(error).__name__}: {error})") from error


def _row(entry: dict[str, Any]) -> Row:
    seconds = None
    if entry.get("median_s") is not None:
        low, high = entry["quartiles_s"]
        seconds = (float(low), float(entry["median_s"]), float(high))
        if not 0 < seconds[0] <= seconds[1] <= seconds[2] < math.inf:
            raise ValueError(f"seconds must be positive and in order; got {seconds} in {entry['what']}")
    told = {name: value for name, value in entry.items() if name not in _OWN}
    return Row(entry["what"], dict(entry["size"]), seconds, dict(entry["error"]), told, entry.get("samples", 1))


_OWN = ("what", "size", "median_s", "quartiles_s", "samples", "error")


def load_folder(folder: Path) -> dict[str, Benchmark]:
    """All benchmarks of a folder by name.

    Raises:
      InputError: there is none.
    """
    found = {file.stem: load(file) for file in sorted(folder.glob("*.json"))}
    if not found:
        raise checks.InputError(f"{folder}: holds no results; `make bench` writes them")
    return found


def spread(row: Row) -> float:
    """The factor within which a second run's median lies (module docstring); 1 where nothing was timed."""
    if row.seconds is None:
        return 1.0
    seen = math.log(row.seconds[2] / row.seconds[0]) / QUARTILES
    noise = max(LEAST_NOISE, seen * (1 + 2 / row.samples))
    variance = 2 * (DRIFT**2 + math.pi / 2 * noise**2 / row.samples)
    return math.exp(CERTAINTY * math.sqrt(variance))


def frontier(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other is at least as good as in both coordinates (small is good), by the first.

    Of equal points the first is kept.
    """
    found: list[int] = []
    for index in sorted(range(len(points)), key=lambda i: (*points[i], i)):
        if not found or points[index][1] < points[found[-1]][1]:
            found.append(index)
    return found


@dataclass(frozen=True)
class Comparison:
    """Two runs of one benchmark. factor: by which the second took longer as a whole; faults: one line each."""

    name: str
    rows: int
    factor: float
    faults: list[str]


def compare(first: Benchmark, second: Benchmark) -> Comparison:
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


def _error_faults(first: Row, second: Row) -> list[str]:
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


def _time_faults(first: Row, second: Row, shared: float) -> list[str]:
    if first.seconds is None or second.seconds is None:
        missing = (first.seconds is None) != (second.seconds is None)
        return [f"{first.label}: timed in one run only"] if missing else []
    ratio, allowed = second.seconds[1] / first.seconds[1], max(spread(first), spread(second))
    off = min(abs(math.log(ratio)), abs(math.log(ratio / shared)))
    if off <= math.log(allowed):
        return []
    times = f"{1e3 * first.seconds[1]:.4g} ms, then {1e3 * second.seconds[1]:.4g} ms"
    return [f"{first.label}: {times}: a factor of {math.exp(off):.2f} besides the common one, stated {allowed:.2f}"]

"""What the benchmarks wrote: rows, how far a median may move in a second run, the frontier.

Spread of a row: the factor within which a second run's median lies, but for one row of a hundred. The difference of
two medians of logarithms has the variance 2 (drift² + π/2 σ²/n). σ, of one sample, is what the quartiles show, widened
by 1 + 2/n, as those of few samples are close together, and no less than `LEAST_NOISE`; n is the number of samples;
`DRIFT` is what a run's own quartiles cannot show: other users, clocks and memory differ from one minute to another.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ddf.core import checks

DRIFT = 0.08  # standard deviation of a median's logarithm from run to run, on a machine that others use too
LEAST_NOISE = 0.10  # σ is taken to be no less: the quartiles of few samples are close together by chance
QUARTILES = 1.349  # distance of a normal distribution's quartiles, in standard deviations
CERTAINTY = 2.6  # standard deviations: 99 % of normal differences


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

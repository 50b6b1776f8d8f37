"""What the benchmarks wrote: rows of speed and error, and which of them are on the frontier."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ddf.core import checks


@dataclass(frozen=True)
class Row:
    """One line.

    seconds: (q1, median, q3), or None where only the error was measured. told: everything else.
    """

    what: str
    size: dict[str, Any]
    seconds: tuple[float, float, float] | None
    error: dict[str, float]
    told: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Benchmark:
    """A file of rows and where they were measured. took_s: seconds of the whole script."""

    name: str
    cpu: str
    cores: int
    threads: int
    versions: dict[str, str]
    rows: list[Row]
    took_s: float


def load(file: Path) -> Benchmark:
    """The rows of one file.

    Raises:
      InputError: it is not such a file, or a row lacks something; named.
    """
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        rows = [_row(entry) for entry in record["rows"]]
        machine = (record["cpu"], record["cores"], record["threads"], record["versions"])
        return Benchmark(record["benchmark"], *machine, rows, record["took_s"])
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
    return Row(entry["what"], dict(entry["size"]), seconds, dict(entry["error"]), told)


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


def frontier(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points that no other is at least as good as in both coordinates (small is good), by the first.

    Of equal points the first is kept.
    """
    found: list[int] = []
    for index in sorted(range(len(points)), key=lambda i: (*points[i], i)):
        if not found or points[index][1] < points[found[-1]][1]:
            found.append(index)
    return found

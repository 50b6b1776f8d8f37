"""Seconds of candidates, and the file of every benchmark: rows in `reports/bench`, always speed beside error.

The environment variable DDF_BENCH_OUT names another folder.
"""

import json
import math
import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ddf.core import storage

_STARTED = time.perf_counter()  # of the script that imports this
ROOT = Path(__file__).resolve().parents[2]
REPORTS = ROOT / "reports"
REAL_MESHES = ROOT.parent / "shared" / "meshes"  # beside the project, where somebody has put them
OUT = Path(os.environ.get("DDF_BENCH_OUT") or REPORTS / "bench")
TICK = 0.01  # seconds that a sample lasts, or longer
PACKAGES = ("torch", "numpy", "open3d", "onnxruntime")
Row = dict[str, Any]  # of a file, see `row`
Rows = Iterator[Row]  # what the `main` of a benchmark gives


def cpu_name() -> str:
    """As the kernel calls it."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def interleaved(
    candidates: Mapping[str, Callable[[], Any]], samples: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, list[float]]:
    """Seconds of one call of each candidate, sampled in turn, so that a busy moment meets them all.

    The first call warms up. A sample is the mean of as many calls as last `TICK`.

    Args:
      clock: `time.process_time` where one thread works, however busy the machine is.
    """
    calls: dict[str, int] = {}
    for name, candidate in candidates.items():
        candidate()
        calls[name] = max(1, math.ceil(TICK / _seconds(candidate, 1, clock)))
    times: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(samples):
        for name, candidate in candidates.items():
            times[name].append(_seconds(candidate, calls[name], clock))
    return times


def _seconds(candidate: Callable[[], Any], calls: int, clock: Callable[[], float]) -> float:
    """Mean of so many calls."""
    started = clock()
    for _ in range(calls):
        candidate()
    return (clock() - started) / calls


def row(what: str, size: Mapping[str, Any], seconds: Sequence[float], error: Mapping[str, float]) -> Row:
    """One line: median and quartiles of the seconds, how many they are, and the error that belongs to them."""
    low, middle, high = statistics.quantiles(seconds, n=4, method="inclusive") if len(seconds) > 1 else [*seconds] * 3
    times = {"median_s": middle, "quartiles_s": [low, high], "samples": len(seconds)}
    return {"what": what, "size": dict(size), **times, "error": dict(error)}


def write(name: str, threads: int, rows: Iterable[Row], kept: bool = False, code: str = "") -> None:
    """`reports/bench/<name>.json` with the machine, threads and versions of the rows, and what all of it took.

    Args:
      rows: each is printed and written as soon as it is there. kept: older rows of other names stay in the file, and of
        the same name what the new one has not. code: what made the rows, see `ddf_lab.engine.publish`.
    """
    file = OUT / f"{name}.json"
    found: list[Row] = storage.read_json(file)["rows"] if kept and file.exists() else []
    record = {
        "benchmark": name,
        "cpu": cpu_name(),
        "cores": os.cpu_count(),
        "threads": threads,
        "versions": {package: storage.version_of(package) for package in PACKAGES},
    }
    OUT.mkdir(parents=True, exist_ok=True)
    for row in rows:
        print(json.dumps({key: row[key] for key in ("what", "size", "error")}, ensure_ascii=False), flush=True)
        before = next((old for old in found if kept and old["what"] == row["what"]), {})
        new = {**row, "error": {**before.get("error", {}), **row["error"]}, "code": code}
        found = [old for old in found if old is not before] + [new]
        told = {**record, "took_s": round(time.perf_counter() - _STARTED, 1), "rows": found}
        file.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")

"""What every benchmark writes: one JSON file of rows in `reports/bench`, always speed beside error.

The environment variable DDF_BENCH_OUT names another folder.
"""

import importlib.metadata
import json
import os
import platform
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
REPORTS = ROOT / "reports"
REAL_MESHES = ROOT.parent / "shared" / "meshes"  # beside the project, where somebody has put them
OUT = Path(os.environ.get("DDF_BENCH_OUT") or REPORTS / "bench")
PACKAGES = ("torch", "numpy", "open3d", "onnxruntime")


def cpu_name() -> str:
    """As the kernel calls it."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines() if Path("/proc/cpuinfo").exists() else []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def interleaved(candidates: Mapping[str, Callable[[], Any]], repeats: int) -> dict[str, list[float]]:
    """Seconds of each candidate, `repeats` times in turn, so that a busy moment meets them all; one warm-up each."""
    for candidate in candidates.values():
        candidate()
    times: dict[str, list[float]] = {name: [] for name in candidates}
    for _ in range(repeats):
        for name, candidate in candidates.items():
            started = time.perf_counter()
            candidate()
            times[name].append(time.perf_counter() - started)
    return times


def row(
    what: str,
    size: Mapping[str, Any],
    seconds: Sequence[float],
    error: Mapping[str, float],
    error_tolerance: float = 0.0,
) -> dict[str, Any]:
    """One line: median and quartiles of the seconds, and the error that belongs to them.

    Args:
      error_tolerance: relative difference of errors from one run to the next; 0 where they do not depend on the run.
    """
    low, middle, high = statistics.quantiles(seconds, n=4, method="inclusive") if len(seconds) > 1 else seconds * 3
    line = {"what": what, "size": dict(size), "median_s": middle, "quartiles_s": [low, high], "error": dict(error)}
    return line | ({"error_tolerance": error_tolerance} if error_tolerance else {})


def write(name: str, threads: int, rows: Sequence[Mapping[str, Any]]) -> None:
    """`reports/bench/<name>.json` with the machine, threads and versions that the rows were measured with."""
    record = {
        "benchmark": name,
        "cpu": cpu_name(),
        "cores": os.cpu_count(),
        "threads": threads,
        "versions": {package: importlib.metadata.version(package) for package in PACKAGES},
        "rows": list(rows),
    }
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / f"{name}.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")

"""Compare two runs of the benchmarks: `python bench/_compare.py FIRST_DIR SECOND_DIR`; code 1 where they differ.

Benchmarks that only one folder holds are named and left out.
"""

import sys
from pathlib import Path

import _results

from ddf.core import checks
from ddf.pipeline import stage


def main() -> None:
    """Print one line per benchmark, and one per row that is outside its spread or has another error."""
    if len(sys.argv) != 3:
        raise checks.InputError("two folders are needed: python bench/_compare.py FIRST_DIR SECOND_DIR")
    first, second = (_results.load_folder(Path(folder)) for folder in sys.argv[1:])
    alone = sorted(first.keys() ^ second.keys())
    if alone:
        print(f"in one folder only: {', '.join(alone)}")
    if not first.keys() & second.keys():
        raise checks.InputError(f"{sys.argv[1]} and {sys.argv[2]} have no benchmark in common")
    faults = 0
    for name in sorted(first.keys() & second.keys()):
        found = _results.compare(first[name], second[name])
        faults += len(found.faults)
        verdict = "agrees" if not found.faults else f"{len(found.faults)} rows or errors differ"
        print(f"{name}: {found.rows} rows, second run x {found.factor:.2f}, {verdict}")
        for fault in found.faults:
            print(f"  {fault}")
    if faults:
        sys.exit(1)


if __name__ == "__main__":
    raise SystemExit(stage.guarded(main, "bench-check"))

"""Faults put into the code one at a time, and whether the tests notice.

Each mutant is one line changed in a copy of the tree; the tests of its rooms then run until one fails. A survivor is a
number of the report that no test holds. Writes reports/mutants.md.
"""

import concurrent.futures
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from bench.lib import measuring
from bench.mutation.faults import MUTANTS, Mutant
from ddf.core import checks, storage
from ddf_lab.report import pages

ON_DEMAND = "python -m bench mutants, ten minutes"
OUT = measuring.PAGES
SIDE_BY_SIDE = 2
COPIED = ("src", "tests", "bench", "stages", "configs", "pyproject.toml", "pipeline.yaml")


def survives(mutant: Mutant) -> tuple[bool, float]:
    """Whether all tests still pass, and the seconds that they took.

    Raises:
      InputError: the line is not in the file, or not once.
    """
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        for name in COPIED:
            source = measuring.ROOT / name
            if source.is_dir():
                shutil.copytree(source, root / name, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy2(source, root / name)
        file = root / "src" / "ddf" / mutant.file
        text = file.read_text(encoding="utf-8")
        if text.count(mutant.old) != 1:
            raise checks.InputError(
                f"{mutant.file}: {mutant.old!r} is there {text.count(mutant.old)} times; say it anew"
            )
        file.write_text(text.replace(mutant.old, mutant.new), encoding="utf-8")
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *mutant.tests]
        environment = os.environ | {"PYTHONPATH": f"{root / 'src'}:{root}", "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, cwd=root, env=environment, capture_output=True, check=False)
    if done.returncode not in (0, 1, 2):
        raise checks.InputError(f"{mutant.name}: the tests did not run: {done.stdout.decode()[-300:]}")
    return done.returncode == 0, time.monotonic() - started


def page(found: Sequence[tuple[Mutant, bool]]) -> pages.Page:
    """What was changed, and whether it was noticed."""
    alive = [mutant.name for mutant, survived in found if survived]
    verdict = f"{len(found)} faults, one at a time: {len(found) - len(alive)} are noticed by a test"
    verdict += f"; these are not: {', '.join(alive)}." if alive else "."
    rows = [[mutant.name, f"`{mutant.file}`", "no" if survived else "yes"] for mutant, survived in found]
    table = pages.Table("Faults and tests.", [("", 3, False)], ["fault", "in src/ddf", "noticed"], rows, labels=2)
    return pages.Page("Mutants", [verdict, "Made by `python -m bench mutants`."], [pages.Section("Faults", [table])])


def main(arguments: Sequence[str]) -> None:
    """All mutants, or those named."""
    chosen = [mutant for mutant in MUTANTS if not arguments or mutant.name in arguments]
    with concurrent.futures.ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        found = []
        for mutant, (survived, seconds) in zip(chosen, pool.map(survives, chosen), strict=True):
            print(f"{'SURVIVES' if survived else 'noticed'}  {mutant.name}  {seconds:.0f} s", flush=True)
            found.append((mutant, survived))
    if not arguments:
        storage.write_text(OUT / "mutants.md", pages.markdown(page(found)))

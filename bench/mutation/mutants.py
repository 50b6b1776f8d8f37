"""Faults put into the code one at a time, and whether the tests notice.

Each fault of `faults.yaml` is one place changed in a copy of the tree; the tests of its rooms then run until one fails.
A survivor is a number of the report that no test holds.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent import futures
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import yaml

from bench.lib import measuring
from ddf.cli.declare import Arg
from ddf.core import checks

ON_DEMAND = "python -m bench mutants, half an hour"
FAULTS = Path(__file__).with_name("faults.yaml")
SIDE_BY_SIDE = 2
COPIED = ("src", "tests", "bench", "stages", "configs", "pyproject.toml", "pipeline.yaml")


@dataclass(frozen=True)
class Mutant:
    """`old` in a file below src becomes `new`; tests: below tests, those that should notice."""

    name: str
    file: str
    old: str
    new: str
    tests: Sequence[str]

    def changed(self, root: Path) -> str:
        """The text of its file below `root`, with the fault; InputError where what it changes is not there once."""
        text = (root / "src" / self.file).read_text(encoding="utf-8")
        if text.count(self.old) != 1:
            raise checks.InputError(f"{self.file}: {self.old!r} is there {text.count(self.old)} times; say it anew")
        return text.replace(self.old, self.new)


def mutants() -> list[Mutant]:
    """All of them."""
    known = yaml.safe_load(FAULTS.read_text(encoding="utf-8"))
    return [
        Mutant(name, file, old, new, entry["tests"])
        for file, entry in known.items()
        for name, (old, new) in entry["faults"].items()
    ]


def survives(mutant: Mutant) -> bool:
    """Whether all tests still pass."""
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        for name in COPIED:
            source = measuring.ROOT / name
            copy = shutil.copytree if source.is_dir() else shutil.copy2
            copy(source, root / name)
        (root / "src" / mutant.file).write_text(mutant.changed(root), encoding="utf-8")
        tests = [f"tests/{name}" for name in mutant.tests]
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", *tests]
        environment = os.environ | {"PYTHONPATH": f"{root / 'src'}:{root}", "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, cwd=root, env=environment, capture_output=True, check=False)
    if done.returncode not in (0, 1, 2):
        raise checks.InputError(f"{mutant.name}: the tests did not run: {done.stdout.decode()[-300:]}")
    return done.returncode == 0


def main(names: Annotated[list[str], Arg("NAME", nargs="*")]) -> None:
    """All mutants, or those named.

    Args:
      names: of faults.
    """
    chosen = [mutant for mutant in mutants() if not names or mutant.name in names]
    alive = []
    with futures.ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        for mutant, survived in zip(chosen, pool.map(survives, chosen), strict=True):
            print(f"{'SURVIVES' if survived else 'noticed'}  {mutant.name}", flush=True)
            alive += [mutant.name] if survived else []
    print(f"{len(chosen) - len(alive)} of {len(chosen)} faults are noticed by a test")

"""Faults put into a copy of the code one at a time, and whether the tests of their rooms notice (`-m faults`).

A survivor is a number of the report that no test holds.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[1]
KNOWN = yaml.safe_load(Path(__file__).with_name("faults.yaml").read_text(encoding="utf-8"))
FAULTS = {
    name: (file, old, new, [f"tests/{test}" for test in entry["tests"]])
    for file, entry in KNOWN.items()
    for name, (old, new) in entry["faults"].items()
}
COPIED = ("src", "tests", "bench", "docs", "stages", "configs", "pyproject.toml", "pipeline.yaml")


def test_each_fault_has_its_place_once_and_tests_that_may_notice():
    assert len(FAULTS) == sum(len(entry["faults"]) for entry in KNOWN.values()) > 40
    for name, (file, old, new, tests) in FAULTS.items():
        assert (ROOT / "src" / file).read_text(encoding="utf-8").count(old) == 1 and old != new, name
        assert tests and all((ROOT / test).exists() for test in tests), name


@pytest.mark.faults
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_noticed(name, tmp_path):
    file, old, new, tests = FAULTS[name]
    for each in COPIED:
        (shutil.copytree if (ROOT / each).is_dir() else shutil.copy2)(ROOT / each, tmp_path / each)
    place = tmp_path / "src" / file
    place.write_text(place.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider", *tests]
    environment = os.environ | {"PYTHONPATH": f"{tmp_path / 'src'}:{tmp_path}", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1, done.stdout[-300:]

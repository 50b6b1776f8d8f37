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
    f"{Path(file).parent}: {name}": (Path("" if file.startswith("bench/") else "src", file), old, new, entry["tests"])
    for file, entry in KNOWN.items()
    for name, (old, new) in entry["faults"].items()
}
FOLDERS = ("src", "tests", "bench", "docs", "stages", "configs", "reports")
COPIED = (*FOLDERS, "pyproject.toml", "pipeline.yaml", "requirements.lock")


def test_each_fault_has_its_place_once_and_tests_that_may_notice():
    assert len(FAULTS) == sum(len(entry["faults"]) for entry in KNOWN.values()) > 40
    for name, (file, old, new, tests) in FAULTS.items():
        assert (ROOT / file).read_text(encoding="utf-8").count(old) == 1 and old != new, name
        assert tests and all((ROOT / "tests" / test).exists() for test in tests), name


def _run(folder: Path, tests: list[str]) -> subprocess.CompletedProcess[str]:
    """Tests in a copy of the code."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-p", "no:cacheprovider"]
    environment = os.environ | {"PYTHONPATH": f"{folder / 'src'}:{folder}", "OMP_NUM_THREADS": "1"}
    named = [f"tests/{test}" for test in tests]
    return subprocess.run([*command, *named], cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    for each in COPIED:
        (shutil.copytree if (ROOT / each).is_dir() else shutil.copy2)(ROOT / each, tmp_path / each)
    return tmp_path


@pytest.mark.faults
@pytest.mark.timeout(3600)
def test_without_a_fault_nothing_is_noticed(copy):
    done = _run(copy, sorted({test for *_, tests in FAULTS.values() for test in tests}))
    assert done.returncode == 0, done.stdout[-2000:]


@pytest.mark.faults
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_noticed(name, copy):
    file, old, new, tests = FAULTS[name]
    place = copy / file
    place.write_text(place.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    done = _run(copy, tests)
    assert done.returncode == 1, done.stdout[-300:]

"""`ddf run` on two stages that write a file each: nothing to do, damage, kills, two calls at once."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ddf.core import storage

SOURCES = Path(__file__).resolve().parents[3] / "src"
STAGE = "of: [figures], each: [], sections: [figures]"
GRAPH = f"""
first: {{{STAGE}, command: python stages/first.py, inputs: [], outputs: [first]}}
figures: {{{STAGE}, command: $LAUNCH python stages/figures.py, inputs: [first], outputs: [figures]}}
"""
SCRIPT = """
import pathlib, time
from ddf_lab.engine import stage

@stage.main()
def make(run):
    out = run.folder({name!r})
    out.mkdir(parents=True, exist_ok=True)
    (out / "half").write_text("half")
    while pathlib.Path("wait").exists():
        time.sleep(0.02)
    (out / "half").write_text("whole")
"""


@pytest.fixture
def folder(tmp_path):
    storage.write_text(tmp_path / "pipeline.yaml", GRAPH)
    storage.write_text(tmp_path / "configs/small.yaml", "figures: {}\n")
    for name in ("first", "figures"):
        storage.write_text(tmp_path / f"stages/{name}.py", SCRIPT.format(name=name))
    return tmp_path


def _start(folder: Path) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", "from ddf import cli; raise SystemExit(cli.main())", "run", "small"]
    variables, pipe = os.environ | {"PYTHONPATH": str(SOURCES)}, subprocess.PIPE
    return subprocess.Popen(
        command, cwd=folder, env=variables, text=True, start_new_session=True, stdout=pipe, stderr=pipe
    )


def _stages(process: subprocess.Popen[str]) -> list[str]:
    _, said = process.communicate(timeout=200)
    assert process.returncode == 0, said
    return [line for line in said.splitlines() if line in ("first", "figures")]


def _wait_for(condition):
    deadline = time.monotonic() + 200
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_run_does_what_is_to_be_done_and_takes_no_half_for_a_whole(folder):
    assert _stages(_start(folder)) == ["first", "figures"]
    assert _stages(_start(folder)) == []
    made = [folder / f"artifacts/small/{name}/half" for name in ("first", "figures")]
    made[0].write_text("other")
    assert _stages(_start(folder)) == ["first"]  # it is the same again, so nothing follows
    made[1].unlink()
    (folder / "wait").touch()
    killed = _start(folder)
    _wait_for(lambda: made[1].exists() and made[1].read_text() == "half")
    waiting = _start(folder)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    (folder / "wait").unlink()
    assert _stages(waiting) == ["figures"]
    assert [path.read_text() for path in made] == ["whole", "whole"]
    assert _stages(_start(folder)) == []

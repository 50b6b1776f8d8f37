"""The engine under fire, on a small experiment in a copy of the repository: kills, two runs, damage, changed keys."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]

ROOT = Path(__file__).resolve().parents[2]
IGNORED = {".git", ".venv", ".make", "artifacts", "reports", "__pycache__", ".pytest_cache"}
LOOP = "src/ddf/models/loop_config.py"
SMALLER = {
    r"categories: .*": "categories: {primitives: 6}",
    r"checkpoint_seconds: float = fixed\(30\.0": "checkpoint_seconds: float = fixed(0.0",
}


CLOUDS = {"pointclouds", "evaluate", "report"}
PATIENCE = 1200  # seconds for a run on a busy machine; nothing is timed


@dataclass
class Run:
    """A call of make that was started."""

    process: subprocess.Popen[bytes]
    log: Path

    @property
    def output(self) -> str:
        return self.log.read_text()

    def wait_for(self, condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert self.process.poll() is None, self.output
            assert time.monotonic() < deadline, self.output
            time.sleep(0.02)


@dataclass
class Workspace:
    """A copy of the repository with one finished run of the smoke experiment."""

    root: Path

    def start(self, *targets: str) -> "Run":
        # A file, not a pipe: what survives a kill goes on writing. READY: this test's own interpreter stands for the
        # environment that make would set up.
        own = {"PYTHONPATH": str(self.root / "src"), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
        log = self.root.parent / f"make.{time.monotonic_ns()}.log"
        with log.open("w") as out:
            process = subprocess.Popen(
                ["make", "READY=ready", "-o", "ready", *targets],
                cwd=self.root,
                env=os.environ | own,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        return Run(process, log)

    def smoke(self, *variables: str) -> list[str]:
        """Run the experiment; the stages that ran: each says its name on a line of its own."""
        run = self.start("smoke", *variables)
        assert run.process.wait(timeout=PATIENCE) == 0, run.output
        return re.findall(r"(?m)^([a-z_]+)(?: primitives)?(?: seed \d+)?$", run.output)

    @property
    def artifacts(self) -> Path:
        return self.root / "artifacts" / "smoke"

    @property
    def table(self) -> str:
        return (self.artifacts / "evaluate" / "si3dr.csv").read_text()

    @property
    def report(self) -> str:
        return (self.artifacts / "report" / "README.md").read_text()

    @contextlib.contextmanager
    def edited(self, file: str, pattern: str, replacement: str) -> Iterator[None]:
        path = self.root / file
        before = path.read_text()
        after, count = re.subn(pattern, replacement, before, count=1)
        assert count == 1
        path.write_text(after)
        try:
            yield
        finally:
            path.write_text(before)


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    root = tmp_path_factory.mktemp("engine") / "copy"
    shutil.copytree(ROOT, root, symlinks=True, ignore=lambda _, names: IGNORED.intersection(names))
    for name, (pattern, replacement) in zip(("configs/smoke.yaml", LOOP), SMALLER.items(), strict=True):
        text, count = re.subn(pattern, replacement, (root / name).read_text(), count=1)
        assert count == 1, pattern
        (root / name).write_text(text)
    result = Workspace(root)
    assert {"report", "export_onnx"} <= set(result.smoke())
    return result


@pytest.mark.parametrize("file", ["configs/smoke.yaml", "src/ddf/core/config.py"])
def test_a_second_call_runs_nothing_nor_does_one_after_a_remark(workspace, file):
    with workspace.edited(file, r"\Z", "\n# a remark\n"):
        assert workspace.smoke() == []
    assert workspace.smoke() == []


@pytest.mark.parametrize(
    ("file", "pattern", "replacement", "stages"),
    [
        ("configs/smoke.yaml", r"oracle_shortlist: \d+", "oracle_shortlist: 1", {"evaluate", "report"}),
        ("src/ddf_lab/evaluation/scoring.py", r"\Z", "\nUNUSED = 1\n", {"evaluate", "report"}),
        ("configs/smoke.yaml", r"(pcsiren: {steps): \d+", r"\1: 7", {"train_pcsiren", *CLOUDS}),
        ("configs/paper.yaml", r"\Z", "pointclouds: {correction: {learning_rate: 0.02}}\n", CLOUDS),  # its base
    ],
)
def test_a_change_runs_the_stages_that_it_reaches_and_what_follows(workspace, file, pattern, replacement, stages):
    table = workspace.table
    with workspace.edited(file, pattern, replacement):
        assert set(workspace.smoke()) == stages
    assert set(workspace.smoke()) == stages
    assert workspace.table == table


@pytest.mark.parametrize(
    ("stage", "sign", "whole_group"),
    [
        ("dataset", "dataset/**/*.png", True),
        ("meshes", "meshes/primitives/000.meshes.safetensors", True),
        ("meshes", "meshes/primitives/000.meshes.safetensors", False),
        ("samples", "samples/primitives/000.samples.safetensors", True),
        ("train_ddf", "train_ddf/primitives/checkpoint.safetensors", True),
        ("train_ddf", "train_ddf/primitives/checkpoint.safetensors", False),
        ("train_pcsiren", "train_pcsiren/primitives/checkpoint.safetensors", True),
        ("pointclouds", "pointclouds/primitives/ddf.safetensors", True),
    ],
)
def test_sigkill_and_again_gives_the_same_table(workspace, stage, sign, whole_group):
    table = workspace.table
    shutil.rmtree(workspace.artifacts / stage)
    for lock in (workspace.artifacts / "times").glob("*.lock"):
        lock.unlink()
    run = workspace.start("smoke")
    run.wait_for(lambda: list(workspace.artifacts.glob(sign)))
    if whole_group:
        os.killpg(run.process.pid, signal.SIGKILL)
    else:
        run.process.kill()
    run.process.wait()
    workspace.smoke()
    assert workspace.table == table
    assert workspace.smoke() == []


def test_further_seeds_are_added_and_left_out_again(workspace):
    table = workspace.table
    trained = {f"train_{name}" for name in ("ddf", "ddf_image", "pcsiren")}
    assert set(workspace.smoke("SEEDS=2")) == {*trained, "pointclouds", "evaluate", "report"}
    assert workspace.smoke("SEEDS=2") == []
    assert (workspace.artifacts / "evaluate_seeds" / "1" / "si3dr.csv").read_text() != table
    assert workspace.table == table
    assert "±" in workspace.report
    assert workspace.smoke() == ["report"]
    assert "±" not in workspace.report and workspace.smoke() == []
    assert workspace.table == table

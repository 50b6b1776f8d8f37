"""The recipes of CONTRIBUTING.md in a copy of the repository with a small experiment: each is applied, and used."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

from ddf.core import config
from ddf.geometry import mesh_io
from ddf_lab import run

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]

ROOT = Path(__file__).resolve().parents[2]
RECIPES = {file.stem: file for file in sorted((ROOT / "docs" / "recipes").glob("*.diff"))}
SMALL = {
    "dataset": {"categories": {"primitives": 6}, "views": 5},
    "samples": {"counts": dict.fromkeys("UABSTO", 300)},
    "ddf": {"steps": 3},
    "pcsiren": {"steps": 3},
    "ddf_image": {"steps": 3},
}


@dataclass(frozen=True)
class Copy:
    """A copy of the repository with its experiment `tiny`."""

    root: Path

    def run(self, *words: str) -> str:
        """What a command prints, run by this interpreter and with this copy's code."""
        paths = {"PYTHONPATH": str(self.root / "src"), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
        environment = {**os.environ, **paths, "DDF_BENCH_OUT": str(self.root / "bench_out"), "OMP_NUM_THREADS": "1"}
        done = subprocess.run(words, cwd=self.root, env=environment, capture_output=True, text=True, timeout=1800)
        assert done.returncode == 0, f"{' '.join(words)}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
        return done.stdout

    def stage(self, *names: str) -> None:
        for name in names:
            category = () if name in (*run.WHOLE, "report") else ("--category", "primitives")
            self.run(sys.executable, f"stages/{name}.py", "--config", "configs/tiny.yaml", *category)

    def set(self, changes: Mapping[str, Any]) -> None:
        """Change settings of the experiment."""
        file = self.root / "configs" / "tiny.yaml"
        file.write_text(yaml.safe_dump(_merged(config.read_yaml(file), changes)))

    def apply(self, recipe: Path) -> None:
        """As `git apply`, unless what it does is there already; then its own tests."""
        if subprocess.run(
            ["git", "apply", "--check", "--reverse", recipe], cwd=self.root, capture_output=True
        ).returncode:
            self.run("git", "apply", "-C1", str(recipe))
        text = recipe.read_text()
        tests = re.findall(r"(?m)^\+\+\+ b/(tests/\S+)", text)
        if tests:
            self.run(sys.executable, "-m", "pytest", "-q", "-n0", "-p", "no:cacheprovider", *tests)

    def artifact(self, path: str) -> Path:
        return self.root / "artifacts" / "tiny" / path

    def log(self, stage: str) -> pd.DataFrame:
        return pd.read_csv(self.artifact(f"{stage}/primitives/log.csv"), comment="#")

    @property
    def page(self) -> str:
        return self.artifact("report/README.md").read_text()


def _merged(given: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    own = {
        key: _merged(given.get(key) or {}, value) if isinstance(value, Mapping) else value
        for key, value in changes.items()
    }
    return {**given, **own}


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Copy:
    """The repository as it is, and a small experiment through all stages."""
    root = tmp_path_factory.mktemp("recipes") / "repository"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    for name in listed.stdout.split("\0"):
        if (ROOT / name).is_file():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, root / name, follow_symlinks=False)
    copy = Copy(root)
    shutil.copyfile(root / "configs" / "smoke.yaml", root / "configs" / "tiny.yaml")
    copy.set(SMALL)
    copy.stage(*run.STAGES, "report")
    return copy


def _loss_term(copy: Copy) -> None:
    copy.set({"ddf": {"weights": {"balance": 0.1}}})
    copy.stage("train_ddf")
    assert np.isfinite(copy.log("train_ddf")["balance"]).all() and len(copy.log("train_ddf"))


def _metric(copy: Copy) -> None:
    for name, last in (("pred", 0.0), ("truth", 2.0)):
        (copy.root / f"{name}.ply").write_bytes(mesh_io.points_ply(np.array([[0.0, 0.0, 0.0], [last, 0.0, 0.0]])))
    assert re.search(r"hausdorff +2 +units of the clouds", copy.run("ddf", "compare", "pred.ply", "truth.ply"))
    copy.stage("evaluate", "report")
    table = pd.read_csv(copy.artifact("report/si3dr.csv"), comment="#")
    assert (table[table["metric"] == "hausdorff_x100"]["value"] > 0).all() and "Hausdorff ↓" in copy.page


def _encoder(copy: Copy) -> None:
    copy.set({"train": {"encoder": "plain"}})
    copy.stage("train_ddf", "train_pcsiren", "train_ddf_image", "pointclouds", "evaluate")
    model = "artifacts/tiny/train_ddf/primitives"
    copy.run("ddf", "export", model, "encoders.onnx", "--graph", "encoders")
    image = next(copy.artifact("dataset/ShapeNetRendering").rglob("00.png"))
    copy.run("ddf", "reconstruct", str(image), model, "reconstructed")


def _stage(copy: Copy) -> None:
    copy.run("ddf", "run", "tiny", "--stage", "cloud_sizes")
    table = pd.read_csv(copy.artifact("cloud_sizes/cloud_sizes.csv"), comment="#")
    assert len(table) >= 1 and (table["points"] > 100).all()


def _config_key(copy: Copy) -> None:
    copy.set({"train": {"loop": {"final_share": 0.5, "warmup_steps": 0}}})
    copy.stage("train_ddf")
    assert len(copy.log("train_ddf"))


def _command(copy: Copy) -> None:
    assert json.loads(copy.run("ddf", "volume", "rabbit", "--json"))["volume"] > 0
    assert "volume" in copy.run("ddf", "--help")


PROMISES: dict[str, Callable[[Copy], None]] = {
    "loss_term": _loss_term,
    "metric": _metric,
    "encoder": _encoder,
    "stage": _stage,
    "config_key": _config_key,
    "command": _command,
}


@pytest.mark.parametrize("name", PROMISES)
def test_recipe_does_what_it_promises(name, finished, tmp_path):
    copy = Copy(tmp_path / "copy")
    shutil.copytree(finished.root, copy.root, symlinks=True)
    copy.apply(RECIPES[name])
    PROMISES[name](copy)

"""Stages on the artefacts of `_fake_experiment`, and the tables of the page that they write."""

import runpy
from pathlib import Path

from _fake_experiment import EVALUATE_SECTION

from ddf_lab.run import Run

ROOT = Path(__file__).resolve().parents[1]


def experiment_run(experiment):
    """A run of cpu.yaml with the fake's own evaluate section."""
    below = ROOT / "configs" / "cpu"
    return Run.read(experiment.write_config(f"base: {below}\nevaluate: {EVALUATE_SECTION}\n"))


def make(stage, run):
    runpy.run_path(str(ROOT / "stages" / f"{stage}.py"))["make"](run)


def markdown_tables(text):
    """Rows of cells of every pipe table, bold marks taken away."""
    tables, rows = [], []
    for line in [*text.splitlines(), ""]:
        if line.startswith("|"):
            rows.append([cell.strip().replace("**", "") for cell in line.strip("|").split(" | ")])
        elif rows:
            tables.append(rows)
            rows = []
    return tables

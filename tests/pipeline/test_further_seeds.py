"""The stages of further seeds reach the engine, and numbers of seeds that make no sense are refused."""

import os
import subprocess

import _pipeline
import pytest
import yaml

from ddf.pipeline import further_seeds

LISTS = _pipeline.load()["vars"][0]


def test_every_item_of_the_experiment_is_there_once_per_further_seed():
    added = further_seeds.further(LISTS, "cpu", 3)
    assert list(added) == ["runs", "evaluations"]
    assert list(added["evaluations"]) == ["cpu-1", "cpu-2"]
    categories = ["car", "plane", "chair"]  # as the pipeline lists them
    assert list(added["runs"]) == [f"cpu-{category}-{seed}" for seed in (1, 2) for category in categories]
    item = added["runs"]["cpu-plane-2"]
    assert item == {"config": "cpu", "category": "plane", "option": " --seed 2", "folder": "_seeds/2"}


def test_one_seed_adds_nothing():
    assert further_seeds.further(LISTS, "paper", 1) == {"runs": {}, "evaluations": {}}


def test_the_file_is_replaced_by_every_call(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pipeline.yaml").write_text(_pipeline.PIPELINE.read_text())
    for seeds in (3, 2, 1):
        further_seeds.main("smoke", str(seeds))
        text = (tmp_path / "params.yaml").read_text()
        assert yaml.safe_load(text) == further_seeds.further(LISTS, "smoke", seeds)
        assert f"SEEDS={seeds}" in text


@pytest.mark.parametrize("seeds", ["0", "-1", "x", "1.5", "2 3", ""])
@pytest.mark.parametrize("target", ["reproduce-table", "smoke", "stage-report", "train"])
def test_a_number_of_seeds_that_makes_no_sense_is_one_line(tmp_path, seeds, target):
    for name in ("Makefile", "pipeline.yaml", "configs"):
        (tmp_path / name).symlink_to(_pipeline.ROOT / name)
    command = ["make", "READY=ready", "-o", "ready", target, f"SEEDS={seeds}"]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("MAKE")}
    result = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert result.returncode == 2
    first, *rest = result.stderr.splitlines()
    assert first == f"SEEDS={seeds}: must be a whole number, 1 or more"
    assert len(rest) == 1 and rest[0].startswith("make: ***")
    assert result.stdout == "" and not (tmp_path / "artifacts").exists()

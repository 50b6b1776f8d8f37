"""What a stage is given."""

import dataclasses
from pathlib import Path

import pytest

from ddf.core import checks
from ddf_lab import run
from ddf_lab.evaluation import scoring
from ddf_lab.run import Run


def test_folders_are_named_after_the_file_the_category_and_the_seed():
    cpu, chair = Run(Path("some/where/cpu.yaml"), {}), Run(Path("cpu.yaml"), {}, "chair", 1)
    assert cpu.folder("meshes", "chair") == chair.folder("meshes") == Path("artifacts/cpu/meshes/chair")
    assert cpu.folder("evaluate", seed=2) == Path("artifacts/cpu/evaluate_seeds/2")
    assert chair.folder("train_ddf", seed=chair.seed) == Path("artifacts/cpu/train_ddf_seeds/1/chair")
    assert chair.index == Path("artifacts/cpu/dataset/index.json")
    assert (cpu.label, chair.label) == ("", "chair seed 1")


def test_sections_are_read_by_their_dataclass(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("evaluate: {tau_sq: 1e-4, oracle_points: 250, oracle_shortlist: 2, seed: 3}\n")
    section = Run.read(path, seed=2).section(scoring.EvaluateConfig)
    assert section == Run.read(path).sections()["evaluate"] and section.seed == 3
    assert Run.read(path, seed=2).reseeded(scoring.EvaluateConfig).seed == 5
    with pytest.raises(checks.InputError, match=r"a\.yaml: section 'evaluate' is missing"):
        Run(path, {}).section(scoring.EvaluateConfig)
    with pytest.raises(ValueError, match=r"run.SECTIONS lists no section of ddf_lab.run:Run"):
        Run.read(path).section(Run)
    path.write_text("evaluat: {}")
    with pytest.raises(checks.InputError, match=r"a\.yaml: unknown section 'evaluat'; the sections are dataset, "):
        Run.read(path)


def test_a_further_seed_moves_every_seed_of_a_section_and_nothing_else():
    loop = dataclasses.make_dataclass("Loop", ["seed", "seeds"], frozen=True)
    train = dataclasses.make_dataclass("Train", ["loop", "name", "seed"], frozen=True)
    assert run.reseeded(train(loop(5, 7), "a", 0), 2) == train(loop(7, 7), "a", 2)

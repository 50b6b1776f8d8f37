"""What a stage is given."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from ddf.core import checks
from ddf_lab import run
from ddf_lab.evaluation import scoring
from ddf_lab.run import Run

TEXT = "evaluate: {tau_sq: 1e-4, oracle_points: 250, oracle_shortlist: 2, seed: 3}\n"


@dataclass(frozen=True)
class Loop:
    seed: int
    seeds: int


@dataclass(frozen=True)
class Train:
    loop: Loop
    name: str
    seed: int


def test_folders_are_named_after_the_file():
    cpu = Run(Path("some/where/cpu.yaml"), {})
    assert cpu.folder("meshes", "chair").as_posix() == "artifacts/cpu/meshes/chair"
    assert cpu.folder("evaluate", seed=2).as_posix() == "artifacts/cpu/evaluate_seeds/2"
    chair = Run(Path("cpu.yaml"), {}, "chair", 1)
    assert chair.folder("samples").as_posix() == "artifacts/cpu/samples/chair"
    assert chair.folder("train_ddf", seed=chair.seed).as_posix() == "artifacts/cpu/train_ddf_seeds/1/chair"
    assert (chair.index.as_posix(), chair.page.as_posix()) == (
        "artifacts/cpu/dataset/index.json",
        "artifacts/cpu/report",
    )
    assert (cpu.label, chair.label) == ("", "chair seed 1")


def test_sections_are_read_by_their_dataclass(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(TEXT)
    section = Run.read(path, seed=2).section(scoring.EvaluateConfig)
    assert section == Run.read(path).sections()["evaluate"] and section.seed == 3
    assert Run.read(path, seed=2).reseeded(scoring.EvaluateConfig).seed == 5
    with pytest.raises(checks.InputError, match=r"a\.yaml: section 'evaluate' is missing"):
        Run(path, {}).section(scoring.EvaluateConfig)
    with pytest.raises(ValueError, match=r"run.SECTIONS lists no section of .*:Loop"):
        Run.read(path).section(Loop)
    path.write_text("evaluat: {}")
    with pytest.raises(checks.InputError, match=r"a\.yaml: unknown section 'evaluat'; the sections are dataset, "):
        Run.read(path)


def test_a_further_seed_moves_every_seed_of_a_section_and_nothing_else():
    section = Train(Loop(5, 7), "a", 0)
    assert run.reseeded(section, 0) == section
    assert run.reseeded(section, 2) == Train(Loop(7, 7), "a", 2)

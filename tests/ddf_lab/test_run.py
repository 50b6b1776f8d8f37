"""What a stage is given."""

import dataclasses

import pytest

from ddf.core import checks
from ddf.models import loop_config, reconstruction_settings
from ddf_lab import run
from ddf_lab.evaluation import scoring
from ddf_lab.run import Run


def test_sections_are_read_by_their_dataclass(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("evaluate: {oracle_points: 250, oracle_shortlist: 2}\n")
    section = Run.read(path, seed=2).section(scoring.EvaluateConfig)
    assert section == Run.read(path).sections()["evaluate"] == scoring.EvaluateConfig(250, 2)
    assert Run.read(path, seed=2).reseeded(scoring.EvaluateConfig).seed == 2
    assert tuple(Run.read(path).given) == run.KINDS["reconstruction"]  # what it does not give has its defaults
    with pytest.raises(checks.InputError, match=r"a\.yaml: section 'evaluate' is missing"):
        Run(path, {}).section(scoring.EvaluateConfig)
    with pytest.raises(ValueError, match=r"run.SECTIONS lists no section of ddf_lab.run:Run"):
        Run.read(path).section(Run)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("evaluat: {}", r"unknown section 'evaluat'; the sections are dataset, .* \(did you mean evaluate\?\)"),
        ("evaluate: {}\nfit: {}", "no kind of experiment has the sections evaluate, fit alone"),
        ("{}", "no kind of experiment has the sections none alone"),
    ],
)
def test_a_file_of_no_experiment_is_one_line(tmp_path, text, message):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(checks.InputError, match=rf"a\.yaml: {message}"):
        Run.read(tmp_path / "a.yaml")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("pcsiren.stepz=7", "unknown key 'stepz'; the keys are steps, points, truth_points (did you mean steps?)"),
        ("pcsiren.steps.more=7", "pcsiren.steps must be of type int; got {'more': 7}"),
        ("ddf.proposals.points=0", "ddf.proposals: points must be >= 1; got 0"),
        ("pcsiren=7", "give section.key=value"),
        ("pcsiren.steps={", "not valid YAML"),
    ],
)
def test_a_change_that_does_not_fit_is_one_line(tmp_path, change, message):
    path = tmp_path / "a.yaml"
    path.write_text("ddf: {}")
    with pytest.raises(checks.InputError) as caught:
        Run.read(path, changes=["dataset.seed=5", change]).sections()
    assert str(caught.value).startswith(f"--set {change}: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_setting_can_be_changed_whether_a_file_gives_it_or_not(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("ddf: {counts: {U: 7, A: 7, B: 7, S: 7, T: 7, O: 7, E: 7}, proposals: {points: 9}}")
    changes = ["train.loop.muon=0.1", "ddf.proposals.points=3", "dataset.categories={car: 5}", "ddf.mask_pixels=4"]
    given = Run.read(path, changes=[*changes, "train.loop.muon=0.2", "evaluate.oracle_points=0x10"]).sections()
    assert given["train"].loop == loop_config.LoopConfig(muon=0.2)  # the last one counts
    assert given["ddf"].proposals == reconstruction_settings.ProposalConfig(3) and given["ddf"].mask_pixels == 4
    assert (given["dataset"].categories, given["evaluate"].oracle_points) == ({"car": 5}, 16)


def test_a_further_seed_moves_every_seed_of_a_section_and_nothing_else():
    loop = dataclasses.make_dataclass("Loop", ["seed", "seeds"], frozen=True)
    train = dataclasses.make_dataclass("Train", ["loop", "name", "seed"], frozen=True)
    assert run.reseeded(train(loop(5, 7), "a", 0), 2) == train(loop(7, 7), "a", 2)

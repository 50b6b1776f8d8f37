"""Experiments are found, not listed; variants have names and folders of their own."""

import shutil
from pathlib import Path

import _pipeline
import pytest

from ddf.core import checks, config
from ddf_lab.engine import experiments, graph

SMOKE = _pipeline.ROOT / "configs" / "smoke.yaml"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A repository with one experiment and one fit."""
    (tmp_path / "configs").mkdir()
    shutil.copy(SMOKE, tmp_path / "configs")
    shutil.copy(SMOKE.parent / "fit.yaml", tmp_path / "configs")
    shutil.copy(_pipeline.PIPELINE, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("given", ["smoke", "configs/smoke.yaml", "./configs/smoke.yaml"])
def test_a_name_or_a_file_is_found(folder, given):
    found = experiments.find(given)
    assert found == experiments.Experiment(Path("configs/smoke.yaml"), ("primitives",))
    assert (found.name, found.kind, found.last_stage) == ("smoke", "reconstruction", "report")
    assert not (folder / "artifacts").exists()


def test_a_file_with_a_fit_alone_is_an_experiment_of_a_shape(folder):
    found = experiments.find("fit")
    assert found.kind == "shape" and found.categories == ()
    assert [item.name for item in graph.expand(found.lists())] == [
        "fit_shape@fit",
        "ablate_samples@fit",
        "report_shape@fit",
    ]


def test_a_file_with_a_vae_is_a_generative_experiment_of_one_category(folder):
    shutil.copy(SMOKE.parent / "smoke_generative.yaml", folder / "configs")
    found = experiments.find("smoke_generative")
    assert (found.kind, found.categories) == ("generative", ("primitives",))
    stages = [item.stage for item in graph.expand(found.lists(seeds=2))]
    assert stages[:4] == ["dataset", "meshes", "samples", "train_vae"] and stages[-1] == found.last_stage
    assert not {"report", "train_ddf", "export_onnx", "fit_shape"} & set(stages)
    with pytest.raises(checks.InputError, match=r"the models are of one category; dataset\.categories has"):
        experiments.find("smoke_generative", ["dataset.categories={chair: 4, car: 4}"])
    text = (folder / "configs/smoke_generative.yaml").read_text()
    (folder / "configs/smoke_generative.yaml").write_text(text.partition("\nscores:")[0])
    with pytest.raises(checks.InputError, match=r"section .scores. is missing; .* configs/generative\.yaml does"):
        experiments.find("smoke_generative")


def test_a_new_experiment_is_one_new_file(folder):
    text = (folder / "configs/smoke.yaml").read_text().replace("{primitives: 12}", "{chair: 4, plane: 4}")
    (folder / "configs/mine.yaml").write_text(text)
    items = [item.name for item in graph.expand(experiments.find("mine").lists(seeds=2))]
    assert [name for name in items if name.startswith("train_ddf")] == [
        "train_ddf@mine-chair",
        "train_ddf@mine-plane",
        "train_ddf@mine-chair-1",
        "train_ddf@mine-plane-1",
    ]
    assert items[0] == "dataset@mine" and items[-1] == "report@mine"


@pytest.mark.parametrize("name", ["my exp", "$(touch PWN)", "a;b", "a-b"])
def test_names_that_a_shell_would_read_are_refused_wherever_they_stand(folder, name):
    shutil.copy(SMOKE, folder / "configs" / f"{name}.yaml")
    with pytest.raises(checks.InputError, match=r"cannot be an experiment's name \(letters, digits and _ only\)"):
        experiments.find(name)
    text = (folder / "configs/smoke.yaml").read_text().replace("{primitives: 12}", f'{{"{name}": 12}}')
    (folder / "configs/smoke.yaml").write_text(text)
    with pytest.raises(checks.InputError, match=r"is no category"):
        experiments.find("smoke")


def test_a_file_from_elsewhere_is_copied_into_a_folder_of_its_own(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("else where") / "mine.yaml"
    shutil.copy(SMOKE, other)
    found = experiments.find(str(other))
    assert found.file == Path("artifacts/mine/mine.yaml")
    assert config.read(found.file) == config.read(SMOKE)
    for name, why in (("smoke", "configs/smoke.yaml has it"), ("a b", "letters, digits and _ only")):
        given = other.with_stem(name)
        shutil.copy(SMOKE, given)
        with pytest.raises(checks.InputError, match=why):
            experiments.find(str(given))


def test_a_variant_has_a_name_of_its_changes(folder):
    found = experiments.find("smoke", ["pcsiren.steps=7", "train.loop.learning_rate=2e-3"])
    assert found.base == "smoke" and found.name.startswith("smoke+")
    assert found.file == Path(f"artifacts/{found.name}/{found.name}.yaml")
    sections = config.read("configs/smoke.yaml")
    sections["pcsiren"]["steps"] = 7
    sections["train"]["loop"]["learning_rate"] = 2e-3
    assert config.read(found.file) == sections
    assert experiments.find("smoke", ["train.loop.learning_rate=0.002", "pcsiren.steps=7"]).name == found.name
    assert experiments.find("smoke", ["pcsiren.steps=8"]).name != found.name
    assert config.read("configs/smoke.yaml")["pcsiren"]["steps"] != 7
    (item,) = (item for item in graph.expand(found.lists()) if item.stage == "train_pcsiren")
    assert item.command.endswith(f"--config {found.file} --category primitives")
    assert item.outs == (f"artifacts/{found.name}/train_pcsiren/primitives",)


def test_a_whole_mapping_can_be_set(folder):
    found = experiments.find("smoke", ["dataset.categories={chair: 2, car: 3}"])
    assert found.categories == ("chair", "car")
    assert config.read(found.file)["dataset"]["categories"] == {"chair": 2, "car": 3}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("pcsiren.stepz=7", "unknown key 'stepz'; the keys of pcsiren are steps, "),
        ("pcsiran.steps=7", "unknown key 'pcsiran'; the keys of the file are dataset, "),
        ("pcsiren.steps.more=7", "unknown key 'more'; the keys of pcsiren.steps are none"),
        ("pcsiren=7", "give section.key=value"),
        ("pcsiren.steps", "give section.key=value"),
        ("pcsiren.steps={", "not valid YAML"),
    ],
)
def test_a_change_that_makes_no_sense_is_one_line_and_writes_nothing(folder, change, message):
    with pytest.raises(checks.InputError) as caught:
        experiments.find("smoke", [change])
    assert str(caught.value).startswith(f"--set {change}: ") and message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (folder / "artifacts").exists()


def test_what_is_not_there_is_one_line_with_what_is(folder):
    with pytest.raises(
        checks.InputError, match=r"^nothing: no such experiment file; those in configs/ are fit, smoke$"
    ):
        experiments.find("nothing")


def test_a_missing_section_is_named(folder):
    text = (folder / "configs/smoke.yaml").read_text().partition("export:")[0]
    (folder / "configs/mine.yaml").write_text(text)
    with pytest.raises(checks.InputError, match=r"configs/mine\.yaml: section 'export' is missing"):
        experiments.find("mine")

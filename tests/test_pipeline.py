"""pipeline.yaml is sound: what it names exists, nothing is made twice, and it sees the code and config really used."""

import re
from pathlib import Path
from typing import Any

import _pipeline
import pytest
import yaml

from ddf import config

STAGES = _pipeline.expand()
ONE_OF_EACH = list({name.split("@")[0]: name for name in STAGES}.values())
CONFIGS = [path for path in sorted((_pipeline.ROOT / "configs").glob("*.yaml")) if not path.stem.endswith("fit")]


def _plain_paths(entries: list[Any]) -> list[str]:
    return [next(iter(entry)) if isinstance(entry, dict) else entry for entry in entries]


OUTS = [path for stage in STAGES.values() for path in _plain_paths(stage["outs"])]


def _makes(path: str, outs: list[str]) -> bool:
    """Whether an earlier out is the path, holds it or lies in it."""
    return any(out == path or path.startswith(f"{out}/") or out.startswith(f"{path}/") for out in outs)


def test_dvc_yaml_is_a_link_to_the_pipeline():
    link = _pipeline.ROOT / "dvc.yaml"
    assert link.is_symlink()
    assert link.readlink() == Path("pipeline.yaml")


@pytest.mark.parametrize("name", STAGES)
def test_deps_exist_or_are_made_by_earlier_stages(name):
    earlier: list[str] = []
    for other, stage in STAGES.items():
        if other == name:
            break
        earlier += _plain_paths(stage["outs"])
    for dep in _plain_paths(STAGES[name]["deps"]):
        by_make = re.fullmatch(r"artifacts/\w+/data_root", dep)
        assert by_make or _makes(dep, earlier) or (_pipeline.ROOT / dep).is_file(), dep


def test_no_output_is_made_twice():
    for i, path in enumerate(OUTS):
        assert not _makes(path, OUTS[:i] + OUTS[i + 1 :]), path


@pytest.mark.parametrize("name", STAGES)
def test_outputs_carry_the_name_of_their_experiment(name):
    experiment = name.split("@")[1].split("-")[0]
    paths = _plain_paths(STAGES[name]["outs"])
    assert all(path.startswith((f"artifacts/{experiment}/", f"reports/{experiment}")) for path in paths)
    data = [dep for dep in _plain_paths(STAGES[name]["deps"]) if dep.startswith("artifacts/")]
    assert all(path.startswith(f"artifacts/{experiment}/") for path in data)
    assert f"--config configs/{experiment}.yaml" in STAGES[name]["cmd"]


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_deps_equal_the_real_imports(name):
    script = _pipeline.script_of(STAGES[name])
    listed = [dep for dep in _plain_paths(STAGES[name]["deps"]) if dep.startswith(("src/", "stages/"))]
    assert listed == _pipeline.code_of(script), "run `make sync-deps`"


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_params_are_the_sections_that_the_script_reads(name):
    stage = STAGES[name]
    listed = {section for entry in stage["params"] for sections in entry.values() for section in sections}
    assert listed == _pipeline.sections_read(_pipeline.script_of(stage))


def test_params_exist_in_the_config():
    contents = {path.relative_to(_pipeline.ROOT).as_posix(): set(config.read(path)) for path in CONFIGS}
    for name, stage in STAGES.items():
        for entry in stage["params"]:
            for file, sections in entry.items():
                assert set(sections) <= contents[file], name


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_tasks_are_the_categories_of_the_config(path):
    lists = _pipeline.load()["vars"][0]
    tasks = {key: item for key, item in lists["tasks"].items() if item["config"] == path.stem}
    assert set(tasks) == {f"{path.stem}-{item['category']}" for item in tasks.values()}
    assert [item["category"] for item in tasks.values()] == list(config.read(path)["dataset"]["categories"])
    assert lists["experiments"][path.stem] == {"config": path.stem}


def test_every_experiment_has_a_config():
    assert set(_pipeline.load()["vars"][0]["experiments"]) == {path.stem for path in CONFIGS}


def test_training_and_resumable_folders_persist():
    for name, stage in STAGES.items():
        options = {key: value for entry in stage["outs"] for key, value in entry.items()}
        resumes = name.split("@")[0] in ("dataset", "meshes", "samples", "train_ddf", "train_pcsiren")
        assert all(option.get("persist", False) == resumes for option in options.values()), name
        assert all(option["cache"] is False for option in options.values()), name


def test_trainings_can_be_launched_elsewhere():
    for name, stage in STAGES.items():
        assert stage["cmd"].startswith("$LAUNCH ") == name.startswith("train_")


def test_stage_scripts_are_thin():
    for script in sorted((_pipeline.ROOT / "stages").glob("*.py")):
        assert len(script.read_text().splitlines()) < 80, script.name


def test_lock_file_holds_no_absolute_paths_and_known_stages_only():
    lock = _pipeline.ROOT / "dvc.lock"
    if not lock.is_file():
        pytest.skip("no dvc.lock yet")
    stages = yaml.safe_load(lock.read_text())["stages"]
    assert set(stages) <= set(STAGES)
    paths = [entry["path"] for stage in stages.values() for kind in ("deps", "outs") for entry in stage.get(kind, [])]
    assert not [path for path in paths if path.startswith(("/", ".."))]

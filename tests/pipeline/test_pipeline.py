"""pipeline.yaml is sound: what it names exists, nothing is made twice, and it sees the code and config really used."""

import re
from pathlib import Path
from typing import Any

import _pipeline
import pytest
import yaml

from ddf.core import config

STAGES = _pipeline.expand()
SEEDED = _pipeline.expand(seeds=3)
ONE_OF_EACH = list({name.split("@")[0]: name for name in STAGES}.values())
FILES = sorted((_pipeline.ROOT / "configs").glob("*.yaml"))
SHAPES = [path for path in FILES if path.stem.endswith("fit")]
CONFIGS = [path for path in FILES if path not in SHAPES]


def _plain_paths(entries: list[Any]) -> list[str]:
    return [next(iter(entry)) if isinstance(entry, dict) else entry for entry in entries]


OUTS = [path for stage in SEEDED.values() for path in _plain_paths(stage["outs"])]


def _makes(path: str, outs: list[str]) -> bool:
    """Whether an earlier out is the path, holds it or lies in it."""
    return any(out == path or path.startswith(f"{out}/") or out.startswith(f"{path}/") for out in outs)


def test_dvc_yaml_is_a_link_to_the_pipeline():
    link = _pipeline.ROOT / "dvc.yaml"
    assert link.is_symlink()
    assert link.readlink() == Path("pipeline.yaml")


@pytest.mark.parametrize("name", SEEDED)
def test_deps_exist_or_are_made_by_earlier_stages(name):
    earlier: list[str] = []
    for other, stage in SEEDED.items():
        if other == name:
            break
        earlier += _plain_paths(stage["outs"])
    for dep in _plain_paths(SEEDED[name]["deps"]):
        by_make = re.fullmatch(r"artifacts/\w+/(data_root|evaluate_seeds|mesh\.sha256)", dep)
        assert by_make or _makes(dep, earlier) or (_pipeline.ROOT / dep).exists(), dep


def test_no_output_is_made_twice():
    for i, path in enumerate(OUTS):
        assert not _makes(path, OUTS[:i] + OUTS[i + 1 :]), path


@pytest.mark.parametrize("name", SEEDED)
def test_outputs_carry_the_name_of_their_experiment(name):
    experiment = name.split("@")[1].split("-")[0]
    paths = _plain_paths(SEEDED[name]["outs"])
    assert all(path.startswith((f"artifacts/{experiment}/", f"reports/{experiment}")) for path in paths)
    data = [dep for dep in _plain_paths(SEEDED[name]["deps"]) if dep.startswith("artifacts/")]
    assert all(path.startswith(f"artifacts/{experiment}/") for path in data)
    assert f"--config configs/{experiment}.yaml" in SEEDED[name]["cmd"]


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_deps_are_the_script_and_the_packages_that_it_imports(name):
    script = _pipeline.script_of(STAGES[name])
    listed = [dep for dep in _plain_paths(STAGES[name]["deps"]) if dep.startswith(("src/", "stages/"))]
    assert listed == _pipeline.code_of(script)


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_params_are_the_sections_that_the_script_reads(name):
    stage = STAGES[name]
    listed = {section for entry in stage["params"] for sections in entry.values() for section in sections}
    assert listed == _pipeline.sections_read(_pipeline.script_of(stage))


def test_params_exist_in_the_config():
    contents = {path.relative_to(_pipeline.ROOT).as_posix(): set(config.read(path)) for path in FILES}
    for name, stage in STAGES.items():
        for entry in stage["params"]:
            for file, sections in entry.items():
                assert set(sections) <= contents[file], name


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_tasks_are_the_categories_of_the_config(path):
    lists = _pipeline.load()["vars"][0]
    tasks = {key: item for key, item in lists["tasks"].items() if item["config"] == path.stem}
    assert set(tasks) == {f"{path.stem}-{item['category']}" for item in tasks.values()}
    sections = config.read(path)
    shares = sections["train"]["step_shares"] or {}  # the longest trainings first, the others as the config has them
    ordered = sorted(sections["dataset"]["categories"], key=lambda category: -shares.get(category, 1.0))
    assert [item["category"] for item in tasks.values()] == ordered
    assert lists["experiments"][path.stem] == {"config": path.stem, "option": "", "folder": ""}
    assert all(item["option"] == item["folder"] == "" for item in tasks.values())


def test_every_experiment_has_a_config():
    assert set(_pipeline.load()["vars"][0]["experiments"]) == {path.stem for path in CONFIGS}
    assert set(_pipeline.load()["vars"][0]["shapes"]) == {path.stem for path in SHAPES}


RESUMING = ("dataset", "meshes", "samples", "train_ddf", "train_pcsiren", "pointclouds", "fit_shape", "ablate_samples")


def test_training_and_resumable_folders_persist():
    for name, stage in SEEDED.items():
        options = {key: value for entry in stage["outs"] for key, value in entry.items()}
        resumes = name.split("@")[0] in RESUMING
        assert all(option.get("persist", False) == resumes for option in options.values()), name
        assert all(option["cache"] is False for option in options.values()), name


def test_trainings_can_be_launched_elsewhere():
    for name, stage in SEEDED.items():
        assert stage["cmd"].startswith("$LAUNCH ") == name.startswith(("train_", "fit_shape", "ablate_samples"))


# Command after the script, data dependencies and output of every stage of one experiment and category. Whatever changes
# here runs again on the next `make reproduce-table`, hours of training included.
RECORDED = {
    "dataset@cpu": ("dataset", "", "data_root", "dataset"),
    "meshes@cpu-car": ("meshes", " --category car", "dataset/index.json", "meshes/car"),
    "samples@cpu-car": ("samples", " --category car", "dataset/index.json meshes/car", "samples/car"),
    "train_ddf@cpu-car": ("train_ddf", " --category car", "dataset/index.json meshes/car samples/car", "train_ddf/car"),
    "train_pcsiren@cpu-car": (
        "train_pcsiren",
        " --category car",
        "dataset/index.json samples/car",
        "train_pcsiren/car",
    ),
    "export_onnx@cpu-car": ("export_onnx", " --category car", "train_ddf/car train_pcsiren/car", "export_onnx/car"),
    "pointclouds@cpu-car": (
        "pointclouds",
        " --category car",
        "dataset/index.json samples/car train_ddf/car train_pcsiren/car",
        "pointclouds/car",
    ),
    "evaluate@cpu": ("evaluate", "", "dataset/index.json samples pointclouds", "evaluate"),
    "report@cpu": (
        "report",
        "",
        "dataset/index.json meshes samples pointclouds evaluate evaluate_seeds train_ddf train_pcsiren",
        None,
    ),
    "train_ddf@cpu-car-2": (
        "train_ddf",
        " --category car --seed 2",
        "dataset/index.json meshes/car samples/car",
        "train_ddf_seeds/2/car",
    ),
    "train_pcsiren@cpu-car-2": (
        "train_pcsiren",
        " --category car --seed 2",
        "dataset/index.json samples/car",
        "train_pcsiren_seeds/2/car",
    ),
    "pointclouds@cpu-car-2": (
        "pointclouds",
        " --category car --seed 2",
        "dataset/index.json samples/car train_ddf_seeds/2/car train_pcsiren_seeds/2/car",
        "pointclouds_seeds/2/car",
    ),
    "fit_shape@fit": ("fit_shape", "", "mesh.sha256", "fit_shape"),
    "ablate_samples@fit": ("ablate_samples", "", "mesh.sha256", "ablate_samples"),
    "report_shape@fit": ("report_shape", "", "fit_shape ablate_samples", None),
    "evaluate@cpu-2": (
        "evaluate",
        " --seed 2",
        "dataset/index.json samples pointclouds_seeds/2",
        "evaluate_seeds/2",
    ),
}


@pytest.mark.parametrize("name", RECORDED)
def test_commands_and_paths_are_those_of_the_record(name):
    stage = SEEDED[name]
    script, arguments, deps, out = RECORDED[name]
    launch = "$LAUNCH " if name.startswith(("train_", "fit_shape", "ablate_samples")) else ""
    experiment = name.split("@")[1].split("-")[0]
    assert stage["cmd"] == f"{launch}python stages/{script}.py --config configs/{experiment}.yaml{arguments}"
    data = [dep for dep in stage["deps"] if dep.startswith("artifacts/")]
    assert data == [f"artifacts/{experiment}/{dep}" for dep in deps.split()]
    assert _plain_paths(stage["outs"]) == [f"artifacts/{experiment}/{out}" if out else f"reports/{experiment}"]


def test_further_seeds_leave_the_stages_of_the_first_as_they_are():
    assert {name: SEEDED[name] for name in STAGES} == STAGES
    added = {name.split("@")[0] for name in SEEDED.keys() - STAGES.keys()}
    assert added == {"train_ddf", "train_pcsiren", "pointclouds", "evaluate"}
    assert len(SEEDED) == len(STAGES) + 2 * (3 * 7 + 3)


def test_code_and_params_of_a_further_seed_are_those_of_the_first():
    for name in SEEDED.keys() - STAGES.keys():
        first, seeded = STAGES[name.rpartition("-")[0]], SEEDED[name]
        code = [[dep for dep in stage["deps"] if not dep.startswith("artifacts/")] for stage in (first, seeded)]
        assert code[0] == code[1] and first["params"] == seeded["params"]


def test_stage_scripts_are_thin():
    for script in sorted((_pipeline.ROOT / "stages").glob("*.py")):
        assert len(script.read_text().splitlines()) <= 80, script.name


def test_lock_file_holds_no_absolute_paths_and_known_stages_only():
    lock = _pipeline.ROOT / "dvc.lock"
    if not lock.is_file():
        pytest.skip("no dvc.lock yet")
    stages = yaml.safe_load(lock.read_text())["stages"]
    assert {re.sub(r"-\d+$", "", name) for name in stages} <= set(STAGES)
    paths = [entry["path"] for stage in stages.values() for kind in ("deps", "outs") for entry in stage.get(kind, [])]
    assert not [path for path in paths if path.startswith(("/", ".."))]

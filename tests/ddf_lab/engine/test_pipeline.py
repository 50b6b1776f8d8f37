"""pipeline.yaml is sound: what it names exists, nothing is made twice, and it sees the code and config really used."""

import re
from pathlib import Path

import _pipeline
import pytest
import yaml

from ddf.core import config

STAGES = _pipeline.expand()
SEEDED = _pipeline.expand(seeds=3)
ONE_OF_EACH = list({item.stage: name for name, item in STAGES.items()}.values())
ENTRIES = yaml.safe_load(_pipeline.PIPELINE.read_text())["stages"]
OUTS = [path for item in SEEDED.values() for path in item.outs]


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
    for other, item in SEEDED.items():
        if other == name:
            break
        earlier += item.outs
    for dep in SEEDED[name].deps:
        by_the_runner = re.fullmatch(r"artifacts/\w+/(data_root|evaluate_seeds|mesh\.sha256)", dep)
        assert by_the_runner or _makes(dep, earlier) or (_pipeline.ROOT / dep).exists(), dep


def test_no_output_is_made_twice():
    for i, path in enumerate(OUTS):
        assert not _makes(path, OUTS[:i] + OUTS[i + 1 :]), path


@pytest.mark.parametrize("name", SEEDED)
def test_paths_carry_the_name_of_their_experiment(name):
    item = SEEDED[name]
    experiment = item.key.split("-")[0]
    assert all(path.startswith((f"artifacts/{experiment}/", f"reports/{experiment}")) for path in item.outs)
    assert all(path.startswith(f"artifacts/{experiment}/") for path in item.data)
    assert f"--config configs/{experiment}.yaml" in item.command
    assert list(item.sections) == [f"configs/{experiment}.yaml"]


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_deps_are_the_script_and_the_packages_that_it_imports(name):
    item = STAGES[name]
    listed = [dep for dep in item.deps if dep not in item.data]
    assert listed == _pipeline.code_of(_pipeline.ROOT / item.script)


@pytest.mark.parametrize("name", ONE_OF_EACH)
def test_params_are_the_sections_that_the_script_reads(name):
    item = STAGES[name]
    (listed,) = item.sections.values()
    assert set(listed) == _pipeline.sections_read(_pipeline.ROOT / item.script)
    assert set(listed) <= set(config.read(_pipeline.ROOT / next(iter(item.sections))))


def test_folders_persist_but_for_reports_and_nothing_is_copied():
    for name, entry in ENTRIES.items():
        for out in entry["do"]["outs"]:
            ((path, options),) = out.items()
            page = path.startswith("reports/")
            assert options == ({"cache": False} if page else {"cache": False, "persist": True}), name


def test_trainings_can_be_launched_elsewhere():
    for item in SEEDED.values():
        launched = item.stage.startswith("train_") or item.stage in ("fit_shape", "ablate_samples")
        assert item.command.startswith("$LAUNCH ") == launched


# Arguments, data and output of every stage of one experiment and category. Whatever changes here runs again
# on the next `make reproduce-table`, hours of training included.
RECORDED = {
    "dataset@cpu": ("", "data_root", "dataset"),
    "meshes@cpu-car": (" --category car", "dataset/index.json", "meshes/car"),
    "samples@cpu-car": (" --category car", "dataset/index.json meshes/car", "samples/car"),
    "train_ddf@cpu-car": (" --category car", "dataset/index.json meshes/car samples/car", "train_ddf/car"),
    "train_pcsiren@cpu-car": (" --category car", "dataset/index.json samples/car", "train_pcsiren/car"),
    "export_onnx@cpu-car": (" --category car", "train_ddf/car train_pcsiren/car", "export_onnx/car"),
    "pointclouds@cpu-car": (
        " --category car",
        "dataset/index.json samples/car train_ddf/car train_pcsiren/car",
        "pointclouds/car",
    ),
    "evaluate@cpu": ("", "dataset/index.json samples pointclouds", "evaluate"),
    "report@cpu": (
        "",
        "dataset/index.json meshes samples pointclouds evaluate evaluate_seeds train_ddf train_pcsiren",
        None,
    ),
    "train_ddf@cpu-car-2": (
        " --category car --seed 2",
        "dataset/index.json meshes/car samples/car",
        "train_ddf_seeds/2/car",
    ),
    "train_pcsiren@cpu-car-2": (
        " --category car --seed 2",
        "dataset/index.json samples/car",
        "train_pcsiren_seeds/2/car",
    ),
    "pointclouds@cpu-car-2": (
        " --category car --seed 2",
        "dataset/index.json samples/car train_ddf_seeds/2/car train_pcsiren_seeds/2/car",
        "pointclouds_seeds/2/car",
    ),
    "fit_shape@fit": ("", "mesh.sha256", "fit_shape"),
    "ablate_samples@fit": ("", "mesh.sha256", "ablate_samples"),
    "report_shape@fit": ("", "fit_shape ablate_samples", None),
    "train_vae@generative-car": (" --category car", "dataset/index.json samples/car", "train_vae/car"),
    "normals@generative-car": (" --category car", "train_vae/car", "normals/car"),
    "train_gan@generative-car": (
        " --category car",
        "dataset/index.json samples/car train_vae/car normals/car",
        "train_gan/car",
    ),
    "train_gan2d@generative-car": (" --category car", "dataset/index.json samples/car", "train_gan2d/car"),
    "train_features@generative-car": (" --category car", "dataset/index.json samples/car", "train_features/car"),
    "evaluate_generative@generative-car": (
        " --category car",
        "dataset/index.json samples/car train_vae/car train_gan/car train_gan2d/car train_features/car",
        "evaluate_generative/car",
    ),
    "report_generative@generative-car": (
        " --category car",
        "evaluate_generative/car train_vae/car train_gan/car train_gan2d/car train_features/car",
        None,
    ),
    "evaluate@cpu-2": (" --seed 2", "dataset/index.json samples pointclouds_seeds/2", "evaluate_seeds/2"),
}


@pytest.mark.parametrize("name", RECORDED)
def test_commands_and_paths_are_those_of_the_record(name):
    item = SEEDED[name]
    arguments, deps, out = RECORDED[name]
    experiment = item.key.split("-")[0]
    command = f"python stages/{item.stage}.py --config configs/{experiment}.yaml{arguments}"
    assert item.command.removeprefix("$LAUNCH ") == command
    assert list(item.data) == [f"artifacts/{experiment}/{dep}" for dep in deps.split()]
    assert list(item.outs) == [f"artifacts/{experiment}/{out}" if out else f"reports/{experiment}"]


def test_further_seeds_leave_the_stages_of_the_first_as_they_are():
    assert {name: SEEDED[name] for name in STAGES} == STAGES
    added = SEEDED.keys() - STAGES.keys()
    assert {name.split("@")[0] for name in added} == {"train_ddf", "train_pcsiren", "pointclouds", "evaluate"}
    for name in added:
        first, seeded = STAGES[name.rpartition("-")[0]], SEEDED[name]
        assert first.sections == seeded.sections and seeded.seed == int(name.rpartition("-")[2])
        code = [[dep for dep in item.deps if dep not in item.data] for item in (first, seeded)]
        assert code[0] == code[1]


def test_stage_scripts_are_thin():
    scripts = sorted((_pipeline.ROOT / "stages").glob("*.py"))
    assert set(ENTRIES) <= {script.stem for script in scripts}
    for script in scripts:
        assert len(script.read_text().splitlines()) < 80, script.name


def test_params_and_lock_of_a_run_are_no_part_of_the_repository():
    ignored = (_pipeline.ROOT / ".gitignore").read_text().splitlines()
    assert {"/params.yaml", "/dvc.lock", "/artifacts/", "/.make/"} <= set(ignored)

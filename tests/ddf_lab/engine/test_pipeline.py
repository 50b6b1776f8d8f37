"""pipeline.yaml is sound: what it names exists, nothing is made twice, and it sees the code and config really used."""

import re
from pathlib import Path

import _pipeline
import pytest
import yaml

from ddf_lab.run import Run


@pytest.fixture(scope="module")
def stages():
    return _pipeline.expand()


@pytest.fixture(scope="module")
def seeded():
    return _pipeline.expand(seeds=3)


def _one_of_each(stages):
    return {item.stage: item for item in stages.values()}.values()


def _makes(path: str, outs: list[str]) -> bool:
    """Whether an earlier out is the path, holds it or lies in it."""
    return any(out == path or path.startswith(f"{out}/") or out.startswith(f"{path}/") for out in outs)


def test_dvc_yaml_is_a_link_to_the_pipeline():
    link = _pipeline.ROOT / "dvc.yaml"
    assert link.is_symlink()
    assert link.readlink() == Path("pipeline.yaml")


def test_deps_exist_or_are_made_by_earlier_stages(seeded):
    earlier: list[str] = []
    for item in seeded.values():
        for dep in item.deps:
            by_the_runner = re.fullmatch(r"artifacts/\w+/(data_root|evaluate_seeds|mesh\.sha256)", dep)
            assert by_the_runner or _makes(dep, earlier) or (_pipeline.ROOT / dep).exists(), (item.name, dep)
        earlier += item.outs


def test_no_output_is_made_twice(seeded):
    outs = [path for item in seeded.values() for path in item.outs]
    for i, path in enumerate(outs):
        assert not _makes(path, outs[:i] + outs[i + 1 :]), path


def test_paths_carry_the_name_of_their_experiment(seeded):
    for item in seeded.values():
        experiment = item.key.split("-")[0]
        run = Run(Path(f"{experiment}.yaml"), {}, item.category, item.seed)
        assert Path(item.outs[-1]) in (run.folder(item.stage, seed=item.seed), run.page), item.name
        assert all(path.startswith(f"artifacts/{experiment}/") for path in item.outs)
        assert all(path.startswith(f"artifacts/{experiment}/") for path in item.data)
        assert f"--config artifacts/{experiment}/{experiment}.yaml" in item.command
        assert set(item.sections) <= {f"artifacts/{experiment}/{experiment}.yaml"}


def test_deps_are_the_script_and_the_packages_that_it_imports(stages):
    for item in _one_of_each(stages):
        listed = [dep for dep in item.deps if dep not in item.data]
        assert listed == _pipeline.code_of(_pipeline.ROOT / item.script), item.name


def test_params_are_the_sections_that_the_script_reads(stages):
    for item in _one_of_each(stages):
        listed = {name for names in item.sections.values() for name in names}
        assert listed == _pipeline.sections_read(_pipeline.ROOT / item.script), item.name


def test_folders_persist_but_for_reports_and_nothing_is_copied():
    for name, entry in yaml.safe_load(_pipeline.PIPELINE.read_text())["stages"].items():
        for out in entry["do"]["outs"]:
            ((path, options),) = out.items()
            page = path.endswith("/report")
            assert options == ({"cache": False} if page else {"cache": False, "persist": True}), name


def test_trainings_can_be_launched_elsewhere(seeded):
    for item in seeded.values():
        launched = item.stage.startswith("train_") or item.stage in ("fit_shape", "ablate_samples")
        assert item.command.startswith("$LAUNCH ") == launched


def test_further_seeds_leave_the_stages_of_the_first_as_they_are(stages, seeded):
    assert {name: seeded[name] for name in stages} == stages
    added = seeded.keys() - stages.keys()
    assert {name.split("@")[0] for name in added} == {"train_ddf", "train_pcsiren", "pointclouds", "evaluate"}
    for name in added:
        first, further = stages[name.rpartition("-")[0]], seeded[name]
        assert first.sections == further.sections and further.seed == int(name.rpartition("-")[2])
        code = [[dep for dep in item.deps if dep not in item.data] for item in (first, further)]
        assert code[0] == code[1]


def test_params_and_lock_of_a_run_are_no_part_of_the_repository():
    ignored = (_pipeline.ROOT / ".gitignore").read_text().splitlines()
    assert {"/params.yaml", "/dvc.lock", "/artifacts/", "/.make/"} <= set(ignored)

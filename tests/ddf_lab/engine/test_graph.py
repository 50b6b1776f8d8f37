"""pipeline.yaml is sound, what a stage needs follows from it; experiments are found, and variants named."""

import re
import shutil
from pathlib import Path

import _pipeline
import pytest
import yaml

from ddf.core import checks, config
from ddf_lab.engine import graph, runner
from ddf_lab.run import Run

SMOKE = _pipeline.ROOT / "configs" / "smoke.yaml"
ITEMS = graph.expand(_pipeline.experiment(SMOKE), path=_pipeline.PIPELINE)
FIRST, SEEDED = _pipeline.expand(), _pipeline.expand(seeds=3)


def _overlaps(path: str, outs: list[str]) -> bool:
    """Whether one of these is the path, holds it or lies in it."""
    return any(out == path or path.startswith(f"{out}/") or out.startswith(f"{path}/") for out in outs)


def test_every_script_is_a_stage_and_every_input_is_made_by_an_earlier_one():
    scripts = {path.stem for path in (_pipeline.ROOT / "stages").glob("*.py")} - {"ship_models"}
    assert scripts == set(graph.load(_pipeline.PIPELINE)) == {item.stage for item in FIRST.values()}
    earlier: list[str] = []
    for item in SEEDED.values():
        for path in item.inputs:
            by_the_runner = re.fullmatch(r"artifacts/\w+/(data_root|evaluate_seeds|mesh\.sha256|start\.sha256)", path)
            assert by_the_runner or _overlaps(path, earlier), (item.name, path)
        earlier += item.outputs


def test_no_output_is_made_twice():
    outs = [path for item in SEEDED.values() for path in item.outputs]
    for i, path in enumerate(outs):
        assert not _overlaps(path, outs[:i] + outs[i + 1 :]), path


def test_outputs_are_the_folders_that_a_run_names_and_commands_say_which():
    for item in SEEDED.values():
        run = Run(item.file, {}, item.category, item.seed)
        assert Path(item.outputs[-1]) in (run.folder(item.stage, seed=item.seed), run.page), item.name
        told = item.command.partition(f"stages/{item.stage}.py")[2].split()
        values = {"--config": item.file.as_posix(), "--category": item.category, "--seed": str(item.seed or "")}
        assert dict(zip(told[::2], told[1::2], strict=True)) == {key: value for key, value in values.items() if value}
        launched = item.stage.startswith("train_") or item.stage in ("fit_shape", "ablate_samples")
        assert item.command.startswith("$LAUNCH ") == launched


def test_the_sections_of_a_stage_are_those_that_its_script_reads():
    for item in {item.stage: item for item in FIRST.values()}.values():
        script = _pipeline.ROOT / "stages" / f"{item.stage}.py"
        assert set(item.entry.sections) == _pipeline.sections_read(script), item.name


def test_further_seeds_leave_the_stages_of_the_first_as_they_are():
    assert {name: SEEDED[name] for name in FIRST} == FIRST
    added = {SEEDED[name].stage for name in SEEDED.keys() - FIRST.keys()}
    assert added == {"train_ddf", "train_pcsiren", "train_ddf_image", "pointclouds", "evaluate"}


@pytest.mark.parametrize(
    ("stage", "needs"),
    [
        ("samples", ["dataset", "meshes", "samples"]),
        ("export_onnx", ["dataset", "meshes", "samples", "train_ddf", "train_ddf_image", "export_onnx"]),
        ("report", [item.stage for item in ITEMS if item.stage != "export_onnx"]),
    ],
)
def test_what_a_stage_needs_ends_with_it(stage, needs):
    assert [item.stage for item in graph.needed(ITEMS, [stage])] == needs


STAGE = "of: [shape], each: [], command: x, sections: [], inputs: [], outputs: []"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, r"^pipeline\.yaml is not here; "),
        ("[]", r"pipeline\.yaml: must hold stages by name"),
        (f"a: {{{STAGE}, togehter: 2}}", r"a: unknown key 'togehter'; .*together"),
        ("a: {of: [shape]}", r"pipeline\.yaml: a: key 'each' is missing"),
    ],
)
def test_a_graph_that_is_not_one_is_one_line(tmp_path, monkeypatch, text, message):
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("pipeline.yaml").write_text(text)
    with pytest.raises(checks.InputError, match=message):
        graph.load()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A repository with one experiment and one fit."""
    (tmp_path / "configs").mkdir()
    shutil.copy(SMOKE, tmp_path / "configs")
    shutil.copy(SMOKE.parent / "paper.yaml", tmp_path / "configs")
    shutil.copy(_pipeline.PIPELINE, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("given", ["smoke", "configs/smoke.yaml", "./configs/smoke.yaml"])
def test_a_name_or_a_file_is_found(folder, given):
    found = graph.experiment(given)
    assert (found.file, found.categories) == (Path("artifacts/smoke/smoke.yaml"), ("primitives",))
    assert (found.name, found.kind) == ("smoke", "reconstruction")
    whole = Run.read(found.file)
    assert whole.sections() == Run.read("smoke").sections()  # nothing is lost, and nothing left to a default
    written = yaml.safe_load(found.file.read_text())
    assert written == {name: config.plain(section) for name, section in whole.sections().items()}


def test_a_comment_a_default_restated_and_what_is_overruled_change_nothing_that_is_watched(folder):
    before, smoke = graph.experiment("smoke").file.read_bytes(), folder / "configs/smoke.yaml"
    smoke.write_text(f"# a remark\n{smoke.read_text()}".replace("loop: {", "loop: {muon: null, "))
    (folder / "configs/paper.yaml").write_text("pcsiren: {points: 99, steps: 99}\n")
    assert graph.experiment("smoke").file.read_bytes() == before
    (folder / "configs/paper.yaml").write_text("pointclouds: {correction: {learning_rate: 0.5}}\n")
    changed = yaml.safe_load(before)
    changed["pointclouds"]["correction"]["learning_rate"] = 0.5  # which smoke.yaml leaves to it
    assert yaml.safe_load(graph.experiment("smoke").file.read_text()) == changed


def test_a_file_with_a_vae_is_a_generative_experiment_of_one_category(folder):
    for name in ("smoke_generative", "paper_generative"):
        shutil.copy(SMOKE.parent / f"{name}.yaml", folder / "configs")
    found = graph.experiment("smoke_generative")
    assert (found.kind, found.categories) == ("generative", ("primitives",))
    stages = [item.stage for item in graph.expand(found, seeds=2)]
    assert stages[:4] == ["dataset", "meshes", "samples", "train_vae"] and stages[-1] == "report_generative"
    assert not {"report", "train_ddf", "export_onnx", "fit_shape"} & set(stages)
    with pytest.raises(checks.InputError, match=r"the models are of one category; dataset\.categories has"):
        graph.experiment("smoke_generative", ["dataset.categories={chair: 4, car: 4}"])


def test_missing_own_shapes_are_told_before_a_stage_starts(folder):
    (folder / "configs/a.yaml").write_text("base: smoke\ndataset: {source: own, own: own, categories: {chair: null}}\n")
    with pytest.raises(checks.InputError, match=r"own/manifest\.csv: is not there, as `ddf shapes add` writes it"):
        runner.run("a")


@pytest.mark.parametrize("name", ["my exp", "$(touch PWN)", "a;b", "a-b"])
def test_names_that_a_shell_would_read_are_refused_wherever_they_stand(folder, name):
    shutil.copy(SMOKE, folder / "configs" / f"{name}.yaml")
    with pytest.raises(checks.InputError, match=r"cannot be an experiment's name \(letters, digits and _ only\)"):
        graph.experiment(name)
    text = (folder / "configs/smoke.yaml").read_text().replace("{primitives: 12}", f'{{"{name}": 12}}')
    (folder / "configs/smoke.yaml").write_text(text)
    with pytest.raises(checks.InputError, match=r"dataset: categories must be among "):
        graph.experiment("smoke")


def test_a_file_from_elsewhere_is_copied_into_a_folder_of_its_own(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("else where") / "mine.yaml"
    shutil.copy(SMOKE, other)
    found = graph.experiment(str(other))
    assert found.file == Path("artifacts/mine/mine.yaml")
    assert Run.read(found.file).sections() == Run.read(SMOKE).sections()
    shutil.copy(SMOKE, other.with_stem("smoke"))
    with pytest.raises(checks.InputError, match=r"configs/smoke\.yaml has it"):
        graph.experiment(str(other.with_stem("smoke")))


def test_a_variant_has_a_name_of_its_changes(folder):
    found = graph.experiment("smoke", ["pcsiren.steps=7", "train.loop.learning_rate=2e-3"])
    assert found.name.startswith("smoke+")
    assert found.file == Path(f"artifacts/{found.name}/{found.name}.yaml")
    sections, plain = Run.read(found.file).sections(), Run.read("smoke").sections()
    assert (sections["pcsiren"].steps, sections["train"].loop.learning_rate) == (7, 2e-3)
    assert {name for name in plain if plain[name] != sections[name]} == {"pcsiren", "train"}
    assert graph.experiment("smoke", ["train.loop.learning_rate=2e-3", "pcsiren.steps=7"]).name == found.name
    assert graph.experiment("smoke", ["pcsiren.steps=8"]).name != found.name
    (item,) = (item for item in graph.expand(found) if item.stage == "train_pcsiren")
    assert item.command.endswith(f"--config {found.file} --category primitives")
    assert item.outputs == [f"artifacts/{found.name}/train_pcsiren/primitives"]

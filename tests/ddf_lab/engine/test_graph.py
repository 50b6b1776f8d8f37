"""pipeline.yaml is sound, and what a stage needs and waits for follows from it."""

import re
from pathlib import Path

import _pipeline
import pytest

from ddf.core import checks
from ddf_lab.engine import graph
from ddf_lab.run import Run

SMOKE = _pipeline.experiment(_pipeline.ROOT / "configs" / "smoke.yaml")
ITEMS = graph.expand(SMOKE, path=_pipeline.PIPELINE)
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

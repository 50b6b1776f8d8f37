"""What a stage needs, and what follows from it."""

import _pipeline
import pytest

from ddf.core import checks
from ddf_lab.engine import dag, graph

SMOKE = _pipeline.experiment(_pipeline.ROOT / "configs" / "smoke.yaml")
ITEMS = graph.expand(SMOKE.lists(), _pipeline.PIPELINE)


def _stages(items):
    return [item.stage for item in items]


def test_what_a_stage_needs_ends_with_it():
    assert _stages(graph.needed(ITEMS, ["samples"])) == ["dataset", "meshes", "samples"]
    assert _stages(graph.needed(ITEMS, ["export_onnx"])) == [
        "dataset",
        "meshes",
        "samples",
        "train_ddf",
        "train_pcsiren",
        "export_onnx",
    ]
    assert "export_onnx" not in _stages(graph.needed(ITEMS, ["report"]))


def test_what_follows_from_a_change():
    assert _stages(graph.affected(ITEMS, ["train_pcsiren@smoke-primitives"])) == [
        "train_pcsiren",
        "pointclouds",
        "evaluate",
        "export_onnx",
        "report",
    ]
    assert _stages(graph.affected(ITEMS, ["report@smoke"])) == ["report"]


def test_outside_the_repository_is_one_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(checks.InputError, match=r"^pipeline\.yaml is not here; "):
        graph.load()


def test_the_drawing_has_one_box_a_stage_and_fits_a_screen():
    cpu = _pipeline.experiment(_pipeline.ROOT / "configs" / "cpu.yaml")
    stages = {stage.name: stage for stage in dag.layout(graph.expand(cpu.lists(seeds=2), _pipeline.PIPELINE))}
    assert stages["train_ddf"].items == 6 and stages["meshes"].items == 3
    assert stages["pointclouds"].after == ("train_ddf", "train_pcsiren")  # and not what these wait for
    assert stages["report"].after == ("evaluate",)
    drawn = dag.svg(list(stages.values()))
    assert drawn.count("<rect") == len(stages) == 9
    assert drawn.count("<path") == sum(len(stage.after) for stage in stages.values())
    width, height = (int(drawn.partition(f'{side}="')[2].partition('"')[0]) for side in ("width", "height"))
    assert width < 1300 and height < 300


def test_the_drawing_is_written_beside_the_artefacts(tmp_path, monkeypatch):
    (tmp_path / "configs").symlink_to(_pipeline.ROOT / "configs")
    (tmp_path / "pipeline.yaml").symlink_to(_pipeline.PIPELINE)
    monkeypatch.chdir(tmp_path)
    lines, folder = dag.write("smoke", [], 1)
    assert [line.split()[0] for line in lines[1:]] == [item.stage for item in ITEMS]
    assert {path.name for path in folder.iterdir()} == {"dag.svg", "dag.md"}
    assert "| pointclouds | 1 | train_ddf, train_pcsiren |" in (folder / "dag.md").read_text()

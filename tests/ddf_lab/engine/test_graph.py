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


def test_the_list_has_a_line_a_stage_with_what_it_waits_for():
    cpu = _pipeline.experiment(_pipeline.ROOT / "configs" / "cpu.yaml")
    found = [line.split(maxsplit=2) for line in dag.lines(graph.expand(cpu.lists(seeds=2), _pipeline.PIPELINE))]
    assert len(found) == 10 and ["train_ddf", "6", "samples"] in found
    assert ["pointclouds", "6", "train_ddf, train_pcsiren"] in found  # and not what these wait for
    assert ["report", "1", "evaluate"] in found

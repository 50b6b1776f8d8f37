"""`ddf view` and `ddf export OUT.html`: a page; bad input is one line and exit code 2."""

import json
import re
from pathlib import Path

import pytest

from ddf import cli
from ddf.core import shipped_models


@pytest.mark.parametrize("command", ["view", "export"])
def test_the_page_is_written(command, work, fitted, capsys):
    out = work / f"{command}.html"
    assert cli.main([command, "--json", str(fitted[0]), str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["bytes"] == out.stat().st_size and "<title>field</title>" in out.read_text()


def test_a_scene_holds_each_field_once(tmp_path, capsys):
    (tmp_path / "two.yaml").write_text("objects: [{field: rabbit}, {field: rabbit, translation: [1, 0, 0]}]")
    sizes = []
    for what in ("rabbit", tmp_path / "two.yaml"):
        assert cli.main(["view", "--json", str(what), str(tmp_path / "page.html")]) == 0
        sizes.append(json.loads(capsys.readouterr().out)["bytes"])
    assert abs(sizes[1] - sizes[0]) < 20_000  # a field has 190,000; first pictures differ


@pytest.mark.parametrize("command", ["view", "export"])
def test_several_fields_stand_side_by_side(command, fitted, tmp_path, capsys):
    out = tmp_path / "row.html"
    assert cli.main([command, "--json", "rabbit", str(fitted[0]), "rabbit", str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["bytes"] == out.stat().st_size and "<title>rabbit, field, rabbit</title>" in out.read_text()
    (record,) = re.findall(r'id="ddf-page">(.*?)</script>', out.read_text())
    places = [field["world_from_mesh"]["translation"][2] for field in json.loads(record)["fields"]]
    assert len(places) == 3 and places[0] > places[2]  # of the rabbits


def test_without_a_file_the_browser_is_asked(fitted, capsys, monkeypatch):
    asked = []
    monkeypatch.setattr("webbrowser.open", lambda address: asked.append(address) or True)
    assert cli.main(["view", "--json", str(fitted[0])]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["opened"] and asked == [Path(result["out"]).as_uri()] and Path(result["out"]).is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["rabbit", "page.png"], "page.png: no such field; a file to write must end in .html"),
        (["page.html"], "no such field"),
        (["rabbit", "armchair", "no_such_field", "page.html"], "no_such_field: no such field"),
        (["rabbit", "chair", "page.html"], "holds no field of a single shape"),
        (["rabbit", f"{shipped_models.place('rabbit')}/field.onnx", "page.html"], "give the folder that"),
        (["rabbit", "scene.yaml", "page.html"], "scene.yaml: a scene file is shown alone"),
        (["no_such_field", "page.html"], "no such field"),
        (["no_such_scene.yaml", "page.html"], "no_such_scene.yaml"),
        (["rabbit", "no/such/folder/page.html"], "there is no folder"),
    ],
)
def test_bad_input_is_one_line(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["view", *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_an_onnx_file_holds_one_model(capsys, tmp_path):
    assert cli.main(["export", "rabbit", "armchair", str(tmp_path / "two.onnx")]) == 2
    error = capsys.readouterr().err
    assert "an ONNX file holds one model" in error and error.count("\n") == 1

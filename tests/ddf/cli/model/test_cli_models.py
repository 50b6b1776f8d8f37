"""`ddf models`: the list, copies, and names in place of paths."""

import json

import pytest

from ddf import cli
from ddf.core import shipped_models


def test_the_list_is_that_of_the_index_and_of_the_files(capsys):
    assert cli.main(["models", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)["models"]
    names = [model["name"] for model in listed]
    assert len(set(names)) == len(names) >= 1
    for model in listed:
        assert model["kind"] in ("field", "reconstruction", "vae")
        folder = shipped_models.place(model["name"])
        assert model["path"] == folder.as_posix() and "card.md" in model["files"]
        assert model["bytes"] == sum((folder / file).stat().st_size for file in model["files"])
    assert cli.main(["models"]) == 0
    header, *rows, verdict = capsys.readouterr().out.splitlines()
    assert header.split() == ["name", "kind", "size", "what"] and [row.split()[0] for row in rows] == names
    assert verdict.startswith(f"{len(names)} models; ")


@pytest.mark.parametrize("place", ["before", "after"])
def test_get_copies_every_file(place, tmp_path, capsys):
    model = shipped_models.listed()[0]
    json_first, json_last = (["--json"], []) if place == "before" else ([], ["--json"])
    assert cli.main(["models", *json_first, "get", model.name, str(tmp_path / "a" / "copy"), *json_last]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["name"], result["bytes"]) == (model.name, model.num_bytes)
    copied = {path.name: path.read_bytes() for path in (tmp_path / "a" / "copy").iterdir()}
    assert copied == {name: (model.folder / name).read_bytes() for name in model.files}


def test_bad_calls_are_one_line_and_exit_2(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    name = shipped_models.listed()[0].name
    for arguments, message in (
        (["get", "nothing", str(tmp_path / "x")], "no model is called 'nothing'; there are "),
        (["get", name, str(tmp_path / "file")], "is a file; give a folder to write"),
    ):
        assert cli.main(["models", *arguments]) == 2
        error = capsys.readouterr().err
        assert message in error and error.count("\n") == 1
    assert not (tmp_path / "x").exists()
    with pytest.raises(SystemExit) as caught:
        cli.main(["models", "get", name])
    assert caught.value.code == 2 and capsys.readouterr().err.count("\n") == 1


def test_a_path_that_exists_goes_before_a_name(tmp_path, monkeypatch):
    name = shipped_models.listed()[0].name
    monkeypatch.chdir(tmp_path)
    assert shipped_models.place(name) == shipped_models.ROOT / name
    (tmp_path / name).mkdir()
    assert shipped_models.place(name).as_posix() == name
    assert shipped_models.place("neither").as_posix() == "neither"
    assert shipped_models.listed(tmp_path) == ()

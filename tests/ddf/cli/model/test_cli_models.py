"""`ddf models`: the list, copies, and names in place of paths."""

import json

import pytest

from ddf.core import shipped_models


def test_the_list_is_that_of_the_index_and_of_the_files(answer, shown):
    listed = answer("models")["models"]
    names = [model["name"] for model in listed]
    assert len(set(names)) == len(names) >= 1
    for model in listed:
        assert model["kind"] in ("field", "reconstruction", "vae")
        folder = shipped_models.place(model["name"])
        assert model["path"] == folder.as_posix() and "card.md" in model["files"]
        assert model["bytes"] == sum((folder / file).stat().st_size for file in model["files"])
    assert max(map(len, shown("models"))) <= 100


@pytest.mark.parametrize("place", ["before", "after"])
def test_get_copies_every_file(place, tmp_path, answer, shown):
    model = shipped_models.listed()[0]
    words = ("get", model.name, tmp_path / "a" / "copy")
    result = answer("models", *words) if place == "after" else json.loads(shown("models", "--json", *words)[0])
    assert (result["name"], result["bytes"]) == (model.name, model.num_bytes)
    copied = {path.name: path.read_bytes() for path in (tmp_path / "a" / "copy").iterdir()}
    assert copied == {name: (model.folder / name).read_bytes() for name in model.files}


def test_a_path_that_exists_goes_before_a_name(tmp_path, monkeypatch):
    name = shipped_models.listed()[0].name
    monkeypatch.chdir(tmp_path)
    assert shipped_models.place(name) == shipped_models.ROOT / name
    (tmp_path / name).mkdir()
    assert shipped_models.place(name).as_posix() == name
    assert shipped_models.place("neither").as_posix() == "neither"
    assert shipped_models.listed(tmp_path) == ()

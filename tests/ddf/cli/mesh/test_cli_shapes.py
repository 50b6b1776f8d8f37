"""`ddf shapes`: counts, licences, credits, and fetching."""

import json

import _shapes
import pytest

from ddf import cli
from ddf.data.public import manifest, packages


@pytest.fixture
def one_package(tmp_path, monkeypatch):
    """A manifest of one chair in one small package, and the folder with that."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    data = _shapes.deb(_shapes.pieces())
    monkeypatch.setattr(packages, "PACKAGES", {"pieces": _shapes.package(data)})
    row = manifest.Row("a", "chair", "train", "pieces", "Set.sh3f/a/a.obj", "", "x y z", (), "CC0-1.0", "Ann")
    monkeypatch.setattr(manifest, "rows", lambda: (row,))
    (tmp_path / "given").mkdir()
    (tmp_path / "given" / "pieces_2.0-1_all.deb").write_bytes(data)
    return tmp_path / "given"


def test_the_list_counts_every_shape_and_names_every_maker(capsys):
    assert cli.main(["shapes", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    rows = manifest.rows()
    assert sum(entry[split] for entry in listed["categories"] for split in manifest.SPLITS) == len(rows)
    assert {name for names in listed["credits"].values() for name in names} == {row.creator for row in rows}
    assert [package["sha256"] for package in listed["packages"]] == [p.sha256 for p in packages.PACKAGES.values()]
    assert cli.main(["shapes"]) == 0
    shown = capsys.readouterr().out
    assert "category  train  validation  test" in shown and "GPL-2.0-or-later: " in shown


def test_get_says_what_it_fetches_and_the_second_needs_no_folder(one_package, capsys):
    assert cli.main(["shapes", "get", "chair", "--from", str(one_package), "--json"]) == 0
    told = capsys.readouterr()
    package = packages.PACKAGES["pieces"]
    assert f"pieces 1:2.0-1: 0 MB, SHA-256 {package.sha256}" in told.err
    assert json.loads(told.out)["packages"][0]["path"] == packages.kept(package).as_posix()
    (one_package / "pieces_2.0-1_all.deb").unlink()
    assert cli.main(["shapes", "get"]) == 0


def test_bad_calls_are_one_line(one_package, capsys):
    assert cli.main(["shapes", "get", "boat"]) == 2
    assert "no category is called 'boat'; there are chair" in capsys.readouterr().err
    (one_package / "pieces_2.0-1_all.deb").write_bytes(b"no package")
    assert cli.main(["shapes", "get", "--from", str(one_package)]) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("ddf shapes: error: ") and "damaged, or not pieces" in last

"""`ddf shapes`: fetching."""

import json

import _shapes

from ddf import cli
from ddf.data.public import manifest, packages


def test_get_says_what_it_fetches_and_the_second_needs_no_folder(tmp_path, monkeypatch, capsys):
    """Of a manifest of one chair in one small package."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    package = _shapes.package(data := _shapes.deb(_shapes.pieces()))
    monkeypatch.setattr(packages, "PACKAGES", {"pieces": package})
    row = manifest.Row("a", "chair", "train", "pieces", "Set.sh3f/a/a.obj", "", "x y z", (), "CC0-1.0", "Ann")
    monkeypatch.setattr(manifest, "rows", lambda: (row,))
    given = tmp_path / "pieces_2.0-1_all.deb"
    given.write_bytes(b"no package")
    get = ["shapes", "get", "chair", "--from", str(tmp_path), "--json"]
    assert cli.main(get) == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("ddf shapes: error: ") and "damaged, or not pieces" in last
    given.write_bytes(data)
    assert cli.main(get) == 0
    told = capsys.readouterr()
    assert f"pieces 1:2.0-1: 0 MB, SHA-256 {package.sha256}" in told.err
    assert json.loads(told.out)["packages"][0]["path"] == packages.kept(package).as_posix()
    given.unlink()
    assert cli.main(["shapes", "get"]) == 0


def test_a_table_is_not_replaced_by_what_it_lists(tmp_path, capsys):
    (tmp_path / "manifest.csv").write_text("file,category\na.obj,chair\n")
    assert cli.main(["shapes", "add", str(tmp_path / "manifest.csv"), "--out", str(tmp_path)]) == 2
    assert "manifest.csv is read and would be replaced by the output" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["manifest.csv"]

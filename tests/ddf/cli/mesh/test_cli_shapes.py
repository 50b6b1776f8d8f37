"""`ddf shapes`: counts, licences, credits, and fetching."""

import json

import _shapes

from ddf import cli
from ddf.data.public import manifest, packages


def test_the_list_counts_every_shape_and_names_every_maker(answer, shown):
    listed, rows = answer("shapes"), manifest.rows()
    assert sum(entry[split] for entry in listed["categories"] for split in manifest.SPLITS) == len(rows)
    assert {name for names in listed["credits"].values() for name in names} == {row.creator for row in rows}
    assert [package["sha256"] for package in listed["packages"]] == [p.sha256 for p in packages.PACKAGES.values()]
    lines, chairs = shown("shapes"), next(each for each in listed["categories"] if each["category"] == "chair")
    names, train = (line.split() for line in lines[:2])
    assert int(train[names.index("chair")]) == chairs["train"] and "GPL-2.0-or-later: " in "\n".join(lines)
    assert max(map(len, lines)) <= 100


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

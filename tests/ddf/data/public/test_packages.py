"""Packages of shapes: whole or not at all, one line for damaged and foreign ones, nothing outside the archive."""

import shutil
import zipfile

import _shapes
import pytest

from ddf.core import checks
from ddf.data.public import packages

DEB = _shapes.deb(_shapes.pieces())
PIECES = _shapes.package(DEB)
WANTED = ["Set.sh3f/a/a.obj", "plane/Models/p.ac", "plane/Liveries/red/"]


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "ddf" / "shapes"


def _put(folder, data, name="pieces_2.0-1_all.deb"):
    folder.mkdir(exist_ok=True)
    (folder / name).write_bytes(data)
    return folder


def _apt(folder, monkeypatch, script):
    """An apt-get of our own, alone on the path but for what it calls."""
    tools = folder / "bin"
    tools.mkdir()
    for tool in ("cp", "sh"):
        (tools / tool).symlink_to(shutil.which(tool))
    (tools / "apt-get").write_text(f"#!/bin/sh\n{script}\n")
    (tools / "apt-get").chmod(0o755)
    monkeypatch.setenv("PATH", str(tools))


def test_wanted_members_are_kept_with_their_looks_and_nothing_else(tmp_path, cache):
    kept = packages.require(PIECES, WANTED, _put(tmp_path / "given", DEB, "renamed.bin"))
    assert kept.parent == cache
    with zipfile.ZipFile(kept) as archive:
        chair = ["Set.sh3f/a/a.mtl", "Set.sh3f/a/a.obj", "Set.sh3f/a/wood.png"]
        assert sorted(archive.namelist()) == [*chair, "plane/Liveries/red/p.png", "plane/Models/p.ac"]
        assert archive.read("Set.sh3f/a/a.obj").decode() == _shapes.OBJ
    shutil.rmtree(tmp_path / "given")
    assert packages.require(PIECES, WANTED, tmp_path / "given") == kept  # nothing is asked for again
    with pytest.raises(checks.InputError, match=r"has no file of pieces 1:2.0-1; put .* into a folder"):
        packages.require(PIECES, [*WANTED, "Set.sh3f/b/b.obj"], tmp_path / "given")


@pytest.mark.parametrize("mode", ["w:gz", "w:bz2", "w"])
def test_other_packings_of_data_are_read(mode, tmp_path):
    data = _shapes.deb(_shapes.pieces(), f"data.tar{mode[1:].replace(':', '.')}", mode)
    packages.require(_shapes.package(data), WANTED, _put(tmp_path / "given", data))


_OTHER = "damaged, or not pieces 1:2.0-1: must have"


@pytest.mark.parametrize(
    ("pinned", "given", "said"),
    [
        *((DEB, given, _OTHER) for given in (DEB[:500] + bytes([DEB[500] ^ 1]) + DEB[501:], DEB[:-9], b"<html>")),
        (b"PK" + bytes(100), None, "no ar archive"),
        (_shapes.deb({}, "data.tar.zst", "w"), None, "zstd"),
        (_shapes.deb({}, "other", "w"), None, "has no data.tar"),
        (DEB[:700], None, "has no |unpacked"),
        (_shapes.deb({"usr/share/pieces/Set.sh3f": b"PK broken"}), None, "unpacked"),
        (_shapes.deb({"usr/share/pieces/plane/Models/p.ac": b""}), None, "has no Set.sh3f/a/a.obj"),
    ],
)
def test_files_that_are_damaged_foreign_or_cannot_be_unpacked_leave_nothing(pinned, given, said, tmp_path, cache):
    with pytest.raises(checks.InputError, match=said) as told:
        packages.require(_shapes.package(pinned), WANTED, _put(tmp_path / "given", given or pinned))
    assert "\n" not in str(told.value) and not list(cache.glob("*.zip"))


def test_no_path_of_a_package_leads_anywhere(tmp_path, cache):
    out = "../../../../escaped"
    members = _shapes.pieces() | {f"usr/share/pieces/plane/Models/{out}.png": b"x", "/etc/escaped": b"x"}
    members["usr/share/pieces/Set.sh3f"] = _shapes.zipped({"a/a.obj": _shapes.OBJ, f"a/{out}.png": "x"})
    data = _shapes.deb(members)
    before = {path for path in tmp_path.rglob("*")}
    packages.require(_shapes.package(data), WANTED, _put(tmp_path / "given", data))
    made = {path.relative_to(tmp_path).parts[0] for path in tmp_path.rglob("*")} - {p.name for p in before}
    assert made == {"cache", "given"}
    assert [path.suffix for path in cache.rglob("*")] == [".zip"]


def test_apt_get_fetches_the_pinned_version_and_a_whole_file_is_not_fetched_again(tmp_path, cache, monkeypatch):
    given = _put(tmp_path / "given", DEB) / "pieces_2.0-1_all.deb"
    _apt(tmp_path, monkeypatch, f'[ "$1 $2" = "download pieces=1:2.0-1" ] && cp {given} pieces_1%3a2.0-1_all.deb')
    packages.require(PIECES, WANTED)
    assert not list((cache / "packages").iterdir())
    packages.kept(PIECES).unlink()
    shutil.copy(given, cache / "packages" / "pieces_1%3a2.0-1_all.deb")  # of a run killed while it unpacked
    (tmp_path / "bin" / "apt-get").unlink()
    packages.require(PIECES, WANTED)


def test_without_apt_get_the_message_says_what_to_put_where(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(checks.InputError, match=rf"pieces_2.0-1_all.deb \({len(DEB)} bytes, SHA-256 {PIECES.sha256}\)"):
        packages.require(PIECES, WANTED)


def test_a_kept_archive_that_was_damaged_says_so(tmp_path):
    kept = packages.require(PIECES, WANTED, _put(tmp_path / "given", DEB))
    kept.write_bytes(kept.read_bytes()[:-30])
    with pytest.raises(checks.InputError, match="damaged; remove it"):
        packages.reading(kept)

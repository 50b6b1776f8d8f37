"""`ddf shapes add`: own meshes turned, looked over and split; a data set takes them; what is wrong is one line each."""

import csv
import json

import _shapes
import numpy as np
import pytest
from _hard import box

from ddf import cli
from ddf.core import checks
from ddf.data import dataset, shapenet
from ddf.data.public import adding, manifest, shapes
from ddf.geometry import mesh_io, raycast


def _chair(depth=0.4):
    """A chair of two boxes, facing X, Z up, its seat wider to its left."""
    return _shapes.joined(box((-0.5, -0.4, 0.0), (depth, 0.5, 0.5)), box((-0.5, -0.4, 0.5), (-0.4, 0.4, 1.1)))


@pytest.fixture(autouse=True)
def one_public_chair(tmp_path, monkeypatch):
    """A manifest of one public chair, a box of 2 x 1 x 1, in a kept package."""
    row = manifest.Row("P__1", "chair", "test", "pieces", "Set.sh3f/a/a.obj", "", "x y z", (), "CC0-1.0", "Ann")
    _shapes.keep_pieces(tmp_path, monkeypatch, (row,))


@pytest.fixture
def folder(tmp_path):
    """A chair, a copy of it of another size, place, heading and format, a copy of the public one, and what is none."""
    folder = tmp_path / "given"
    (folder / "more").mkdir(parents=True)
    _chair().save(folder / "a chair.glb")
    copy = _shapes.moved(_chair(), 40.0, (9, 0, 3))
    mesh_io.Mesh(copy.vertices * [-1, -1, 1], copy.faces).save(folder / "more" / "copy.stl")
    box((0.0, 0.0, 0.0), (1.0, 2.0, 1.0)).save(folder / "public.ply")
    box((0.0, 0.0, 0.0), (1.0, 1.0, 0.001)).save(folder / "sheet.obj")
    (folder / "torn.off").write_text("OFF 3 1 0\n0 0 0\n")
    (folder / "notes.txt").write_text("no mesh")
    return folder


def _add(source, out, **given):
    return adding.add(out, source, {"category": "", "up": "z", "front": "x", **given})


def _table(path):
    return list(csv.DictReader(path.read_text().splitlines()))


def test_a_folder_becomes_shapes_in_the_frame_of_v1_and_each_fault_one_line(folder, tmp_path, capsys, caplog):
    command = ["shapes", "add", str(folder), "--category", "chair", "--up", "z", "--front", "x", "--json"]
    assert cli.main(command) == 0
    said = json.loads(capsys.readouterr().out)
    out = tmp_path / "XDG_DATA_HOME" / "ddf" / "shapes"
    (entry,) = _table(out / "manifest.csv")
    assert said["taken"] == [entry] and entry["file"] == str(folder / "a chair.glb") and said["out"] == out.as_posix()
    assert (entry["pieces"], entry["openings"], entry["split"]) == ("1", "0", "train")
    mesh = mesh_io.load(adding.place(out, entry))
    lower, upper = mesh.box()
    assert np.linalg.norm(upper - lower) == pytest.approx(1, abs=1e-6) and np.abs(lower + upper).max() < 1e-6
    top = mesh.vertices[mesh.vertices[:, 1] > upper[1] - 1e-6]
    assert top[:, 0].max() < 0 < top[:, 2].mean() and raycast.Scene(mesh).outside(upper[None] * [1, 1, 0]).all()
    faults = {"more/copy.stl": f"a copy of {entry['id']}, 0.0", "public.ply": "a copy of P__1, 0.0"}
    faults |= {"sheet.obj": "flat: its box is 0.0007", "torn.off": "the header claims 3 vertices"}
    assert len(said["left_out"]) == len(faults) and set(said["left_out"]) <= set(caplog.messages)
    for line, (name, reason) in zip(sorted(said["left_out"]), faults.items(), strict=True):
        assert line.startswith(f"{folder / name}: {reason}") and "\n" not in line


def test_an_edited_manifest_is_read_again_and_others_stay(folder, tmp_path):
    out = tmp_path / "out"
    (entry,), _ = _add(folder, out, category="chair")
    _chair(0.9).save(tmp_path / "bench" / "long.ply")
    _add(tmp_path / "bench", out, category="bench")
    assert [each["category"] for each in _table(out / "manifest.csv")] == ["bench", "chair"]
    text = (out / "manifest.csv").read_text()
    (out / "manifest.csv").write_text(text.replace(",z,x,", ",z,-x,").replace(",train,", ",test,"))
    before = mesh_io.load(adding.place(out, entry)).vertices
    (again,), left_out = _add(out, out, category="chair")
    assert (again["front"], again["split"], left_out) == ("-x", "test", []) and len(_table(out / "manifest.csv")) == 2
    np.testing.assert_allclose(mesh_io.load(adding.place(out, again)).vertices, before * [-1, 1, -1], atol=1e-7)
    (tmp_path / "bench" / "long.ply").unlink()
    _, (left_out,) = _add(out, out)  # whose mesh is kept, perhaps as the last one
    assert "long.ply: " in left_out and len(_table(out / "manifest.csv")) == len([*out.glob("bench/*.ply")]) + 1 == 2


def test_a_manifest_gives_category_axes_and_makers_and_words_are_noted(folder, tmp_path):
    (folder / "chair").mkdir()
    (folder / "a chair.glb").rename(folder / "chair" / "a.glb")
    lines = "file,author,front,up,split\nchair/a.glb,Ann,varies,+Z,val\npublic.ply,Bob,y,z,\n"
    (folder / "manifest.csv").write_text(lines)
    with pytest.raises(checks.InputError, match=r"public.ply: give --category, or a column `category`"):
        _add(folder, tmp_path / "out")
    (entry,), left_out = _add(folder, tmp_path / "out", category="chair")
    assert (entry["author"], entry["front"], entry["up"]) == ("Ann", "x", "+Z") and len(left_out) == 1
    assert entry["note"] == "front 'varies' is no axis; split 'val' is no side"
    (folder / "manifest.csv").write_text("file,front,up\nchair/a.glb,x,-X\n")
    for category, reason in (("car", "has no mesh of category car"), ("", "not one of 1 meshes can be used")):
        with pytest.raises(checks.InputError, match=reason):
            _add(folder, tmp_path / "out", category=category)


def test_makers_are_on_one_side_each_and_old_sides_stay():
    names = [f"{maker}{number}" for maker in "abcdefghij" for number in range(4)]
    entries = [{"id": name, "category": "chair", "author": name[0], "split": ""} for name in names]
    found = adding.split(entries)
    of_maker = {entry["author"]: entry["split"] for entry in found}
    assert all(entry["split"] == of_maker[entry["author"]] for entry in found)
    assert sorted(of_maker.values()) == ["test", *["train"] * 8, "validation"]
    more = adding.split([*found, *({**entry, "id": f"{entry['id']}+", "split": ""} for entry in entries)])
    assert all(entry["split"] == of_maker[entry["author"]] for entry in more)
    alone = adding.split([{**entry, "author": "a"} for entry in entries])
    assert [sum(entry["split"] == side for entry in alone) for side in manifest.SPLITS] == [30, 6, 4]


@pytest.mark.parametrize(("source", "count", "kind"), [("own", None, "public"), ("synthetic", 2, "both")])
def test_a_data_set_takes_own_shapes_in_paint_and_refuses_changed_ones(source, count, kind, tmp_path):
    for number in range(3):
        _chair(0.4 + 0.2 * number).save(tmp_path / "given" / f"{number}.ply")
    taken, _ = _add(tmp_path / "given", tmp_path / "own", category="chair")
    section = dataset.DatasetConfig(source, {"chair": count}, 0, 5, False, own=tmp_path / "own")
    index = dataset.make(section, tmp_path / "out")
    own = [shape for shape in index["categories"]["chair"]["shapes"] if manifest.is_real(shape["id"])]
    assert index["source"] == kind and {shape["id"] for shape in own} == {entry["id"] for entry in taken}
    assert sorted(len(shape["train_views"]) for shape in own) == [0, 0, 12]
    image = shapenet.read_image(shapenet.image_path(tmp_path / "out", "03001627", taken[0]["id"], 0), 137)
    assert image[3].any() and np.ptp(image[:3, image[3] == 1].numpy(), axis=1).max() > 0.05
    adding.place(tmp_path / "own", taken[0]).write_bytes(mesh_io.ply_bytes(_chair()))
    with pytest.raises(checks.InputError, match="changed since it was written"):
        shapes.write_shape(tmp_path, 0, tmp_path / "own", section.rows()[0], 0, 5)
    with pytest.raises(checks.InputError, match=r"categories.lamp: .*own has no such shape"):
        dataset.make(dataset.DatasetConfig("own", {"lamp": None}, 0, 5, False, own=tmp_path / "own"), tmp_path / "out")

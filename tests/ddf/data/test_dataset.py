"""The stage `dataset`: one path for synthetic and real data, broken shapes left out, wrong roots refused."""

import dataclasses
import json
import shutil
from pathlib import Path

import _shapes
import numpy as np
import pytest

from ddf.core import checks
from ddf.data import dataset, shapenet, splits
from ddf.data.public import manifest
from ddf.data.synthetic import write
from ddf.geometry import mesh_io

CHAIR = "03001627"
SIDES = ("train", "test", "validation")


def _config(**changes):
    values = {"source": "synthetic", "categories": {"primitives": 3}, "seed": 1, "views": 5, "strict": False}
    return dataset.DatasetConfig(**{**values, **changes})


def _image(root, shape_id, view, synset=CHAIR):
    return shapenet.image_path(root, synset, shape_id, view)


@pytest.fixture(scope="module")
def real_root(tmp_path_factory):
    """A root in the layout of real data, with six chairs."""
    root = tmp_path_factory.mktemp("shapenet")
    for index in range(6):
        write.write_shape(root, 0, "chair", index, 5)
    return root


@pytest.fixture
def copy_of_root(real_root, tmp_path, monkeypatch):
    shutil.copytree(real_root, tmp_path / "root")
    monkeypatch.setenv("DDF_DATA", str(tmp_path / "root"))
    return tmp_path / "root"


def _run(section, out_dir):
    dataset.write_index(section, out_dir)
    return json.loads((out_dir / "index.json").read_text())


def test_synthetic_set_is_made_checked_and_indexed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    out_dir = Path("artifacts/smoke/dataset")
    index = _run(_config(), out_dir)
    assert index["root"] == "artifacts/smoke/dataset"
    entry = index["categories"]["primitives"]
    listed = shapenet.list_shapes(out_dir, entry["synset"])
    assert [shape["id"] for shape in entry["shapes"]] == sorted(listed, key=splits.natural_key)
    assert [len(shape["train_views"]) for shape in entry["shapes"]] == [5, 5, 2]
    assert sorted(listed) == sorted(write.shape_id(1, "primitives", i) for i in range(3))
    data = shapenet.Dataset.open(out_dir / "index.json")
    assert data.image("primitives", listed[0], 4, 32).shape == (4, 32, 32)
    assert data.model("primitives", listed[0]).is_file()
    fewer = _run(_config(categories={"primitives": 2}), out_dir)
    assert len(fewer["categories"]["primitives"]["shapes"]) == 2
    assert len(shapenet.list_shapes(out_dir, entry["synset"])) == 2


def test_damaged_synthetic_file_is_made_anew(tmp_path):
    first = _run(_config(), tmp_path)
    shape = first["categories"]["primitives"]["shapes"][1]["id"]
    path = _image(tmp_path, shape, 2, "00000001")
    whole = path.read_bytes()
    path.write_bytes(whole[:-40])
    assert _run(_config(), tmp_path) == first
    assert path.read_bytes() == whole


def test_real_and_synthetic_roots_give_the_same_index(copy_of_root, tmp_path):
    made = _run(_config(categories={"chair": 6}, seed=0), tmp_path / "made")
    read = _run(_config(source="shapenet", categories={"chair": None}), tmp_path / "read")
    assert read["root"] == copy_of_root.as_posix()
    assert read["categories"] == made["categories"]
    some = _run(_config(source="shapenet", categories={"chair": 3}), tmp_path / "some")
    kept = [shape["id"] for shape in some["categories"]["chair"]["shapes"]]
    assert kept == [shape["id"] for shape in read["categories"]["chair"]["shapes"]][::2]


def _as_v2(model):
    (model.parent / "models").mkdir()
    model.rename(model.parent / "models" / "model_normalized.obj")


def _faults(root, shape):
    """One function per fault, and what the report must say."""
    folder = shapenet.rendering_dir(root, CHAIR, shape)
    metadata = folder / "rendering_metadata.txt"
    image = _image(root, shape, 3)
    return {
        "03.png: no such image": image.unlink,
        "not a readable PNG": lambda: image.write_bytes(image.read_bytes()[:300]),
        "must hold 5 lines": lambda: metadata.write_text("10 25 0 0.7 25\n" * 4),
        "rendering_metadata.txt:1": lambda: metadata.write_text("10 25 0\n" * 5),
        "metadata.txt: no such file": metadata.unlink,
        "model.obj: no such mesh, or an empty": shapenet.model_path(root, CHAIR, shape).unlink,
        "laid out as ShapeNetCore.v2": lambda: _as_v2(shapenet.model_path(root, CHAIR, shape)),
    }


@pytest.mark.parametrize("fault", list(_faults(Path(), "x")))
def test_one_broken_shape_is_reported_and_left_out_and_moves_no_other(copy_of_root, tmp_path, fault):
    section = _config(source="shapenet", categories={"chair": None})
    before = _run(section, tmp_path / "before")["categories"]["chair"]["shapes"]
    broken = before[2]["id"]
    _faults(copy_of_root, broken)[fault]()
    after = _run(section, tmp_path / "after")["categories"]["chair"]["shapes"]
    assert after == [shape for shape in before if shape["id"] != broken]
    rows = (tmp_path / "after" / "failures.csv").read_text().splitlines()
    assert len(rows) == 2 and rows[1].startswith(f"{broken},dataset,") and fault in rows[1]


def test_too_many_broken_shapes_stop_the_stage_until_they_are_mended(copy_of_root, tmp_path):
    section = _config(source="shapenet", categories={"chair": None})
    images = [_image(copy_of_root, shape, 0) for shape in shapenet.list_shapes(copy_of_root, CHAIR)[:2]]
    whole = [path.read_bytes() for path in images]
    for path in images:
        path.unlink()
    with pytest.raises(checks.InputError, match="2 of 6 shapes failed"):
        _run(section, tmp_path / "out")
    assert not (tmp_path / "out" / "index.json").exists()
    for path, data in zip(images, whole, strict=True):
        path.write_bytes(data)
    assert len(_run(section, tmp_path / "out")["categories"]["chair"]["shapes"]) == 6


def test_missing_roots_say_how_to_give_one(tmp_path, monkeypatch):
    section, root = _config(source="shapenet", categories={"chair": None}), tmp_path / "nowhere"
    hint = "make reproduce-table CONFIG=configs/paper.yaml DATA=/path/to/shapenet"
    monkeypatch.delenv("DDF_DATA", raising=False)
    with pytest.raises(checks.InputError, match=hint):
        dataset.make(section, tmp_path / "out")
    monkeypatch.setenv("DDF_DATA", str(root))
    for then_made, message in (
        ("ShapeNetCore.v2", f"nowhere/ShapeNetCore.v1: no such folder.*{hint}"),
        ("ShapeNetCore.v1", r"nowhere: holds ShapeNetCore\.v2, .* unpack ShapeNetCore\.v1 there"),
        ("ShapeNetRendering", "ShapeNetRendering: no such folder"),
        ("", f"{CHAIR}: no such folder; unpack"),
    ):
        with pytest.raises(checks.InputError, match=message):
            dataset.make(section, tmp_path / "out")
        (root / then_made).mkdir(parents=True, exist_ok=True)
    kinds = ("ShapeNetRendering", "ShapeNetCore.v1")
    for kind in kinds:
        (root / kind / CHAIR / "a").mkdir(parents=True)
    for twice in [f"{kind}/{inner}" for kind in kinds for inner in (kind, f"{CHAIR}/{CHAIR}")]:
        (root / twice).mkdir()
        with pytest.raises(checks.InputError, match=f"{twice}: nested twice; move what it holds one folder up"):
            dataset.make(section, tmp_path / "out")
        (root / twice).rmdir()


@pytest.fixture
def public_chairs(tmp_path, monkeypatch):
    """A manifest of one training, one validation and one test chair, all the same cube, in a kept package."""
    place = ("pieces", "Set.sh3f/a/a.obj", "", "x y z", (), "CC0-1.0", "Ann")
    rows = tuple(manifest.Row(f"S__{split}", "chair", split, *place) for split in manifest.SPLITS)
    _shapes.keep_pieces(tmp_path, monkeypatch, rows)


def _views(index, side):
    return {entry["id"]: len(entry[f"{side}_views"]) for entry in index["categories"]["chair"]["shapes"]}


def test_public_shapes_are_split_by_the_manifest_and_training_ones_vary(public_chairs, tmp_path):
    section = _config(source="public", categories={"chair": None}, public=dataset.PublicConfig(views=6, copies=2))
    index = _run(section, tmp_path / "out")
    trained = dict.fromkeys(("S__train", "S__train--1", "S__train--2"), 6)
    assert _views(index, "train") == {**trained, "S__validation": 0, "S__test": 0}
    assert _views(index, "test")["S__test"] == _views(index, "validation")["S__validation"] == 5
    data = shapenet.Dataset.open(tmp_path / "out" / "index.json")
    ids = [entry.id for entry in data.categories["chair"].shapes]
    sides = {name: np.ptp(mesh_io.load(data.model("chair", name)).vertices, axis=0) for name in ids}
    np.testing.assert_allclose(sides["S__train"], np.array([2, 1, 1]) / 6**0.5, atol=1e-6)
    np.testing.assert_array_equal(sides["S__test"], sides["S__train"])
    assert np.abs(sides["S__train--1"] - sides["S__train"]).max() > 0.01
    assert np.abs(sides["S__train--1"] - sides["S__train--2"]).max() > 0.01
    assert len(data.cameras("chair", "S__train--2")) == 6 and data.image("chair", "S__test", 4, 32)[3].any()


def test_both_sources_train_test_and_validate(public_chairs, tmp_path):
    index = _run(_config(source="both", categories={"chair": 10}, validation=0.25), tmp_path)
    trained = [name for name, count in _views(index, "train").items() if count]
    assert (len([n for n in trained if "__" not in n]), len([n for n in trained if "__" in n])) == (6, 1)
    tested, held = ({n for n, c in _views(index, side).items() if c} for side in ("test", "validation"))
    assert len(tested) == len(held) == 3 and "S__test" in tested and "S__validation" in held
    assert len(shapenet.list_shapes(tmp_path, CHAIR)) == len(index["categories"]["chair"]["shapes"])


def test_a_model_to_ship_learns_wide_shapes_and_those_that_ask_for_credit_at_most(public_chairs, tmp_path, monkeypatch):
    own = manifest.rows()
    taught = {"CC-BY-3.0-US": "train", "CC-BY-SA-3.0": "validation", "GPL-2.0-only": "validation"}
    more = (
        dataclasses.replace(own[0], id=f"S__{licence.replace('.', '-')}", split="train", licence=licence)
        for licence in taught
    )
    rows = (*own, *more)
    monkeypatch.setattr(manifest, "rows", lambda: rows)
    settings = {"source": "both", "categories": {"chair": 10}, "validation": 0.25}
    copies = dataset.PublicConfig(views=5, copies=1)
    plain, shipped = tmp_path / "plain", tmp_path / "shipped"
    _run(_config(**settings), plain)
    index = _run(_config(**settings, train_on="shippable", public=copies), shipped)
    for licence, side in {**taught, "train": "train", "test": "test"}.items():
        assert [name for name in SIDES if _views(index, name)[f"S__{licence.replace('.', '-')}"]] == [side]
    copied = {entry["id"] for entry in index["categories"]["chair"]["shapes"] if "--" in entry["id"]}
    assert copied == {"S__train--1", "S__CC-BY-3-0-US--1"}
    made = {name: bool(count) for name, count in _views(index, "train").items() if "__" not in name}
    assert set(made.values()) == {True, False}
    for name, trained in made.items():
        before, after = (shapenet.model_path(root, CHAIR, name).read_bytes() for root in (plain, shipped))
        assert (before != after) == trained, "wide shapes train, and nothing else changes"

"""The stage `dataset`: one path for synthetic and real data, broken shapes left out, wrong roots refused."""

import json
import shutil
from pathlib import Path

import pytest

from ddf.core import checks, config
from ddf.data import dataset, shapenet, splits
from ddf.data.synthetic import write

CHAIR = "03001627"


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
    section = _config(source="shapenet", categories={"chair": None})
    monkeypatch.delenv("DDF_DATA", raising=False)
    hint = "make reproduce-table CONFIG=configs/paper.yaml DATA=/path/to/shapenet"
    with pytest.raises(checks.InputError, match=hint):
        dataset.make(section, tmp_path / "out")
    monkeypatch.setenv("DDF_DATA", str(tmp_path / "nowhere"))
    with pytest.raises(checks.InputError, match=f"nowhere/ShapeNetCore.v1: no such folder.*{hint}"):
        dataset.make(section, tmp_path / "out")
    (tmp_path / "nowhere" / "ShapeNetCore.v2").mkdir(parents=True)
    with pytest.raises(checks.InputError, match=r"nowhere: holds ShapeNetCore\.v2, .* unpack ShapeNetCore\.v1 there"):
        dataset.make(section, tmp_path / "out")
    (tmp_path / "nowhere" / "ShapeNetCore.v1").mkdir(parents=True)
    with pytest.raises(checks.InputError, match="ShapeNetRendering: no such folder"):
        dataset.make(section, tmp_path / "out")
    (tmp_path / "nowhere" / "ShapeNetRendering").mkdir()
    with pytest.raises(checks.InputError, match=f"{CHAIR}: no such folder; unpack"):
        dataset.make(section, tmp_path / "out")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"categories": {}}, "dataset.categories"),
        ({"categories": {"boat": 3}}, "boat"),
        ({"categories": {"sofa": 3}}, "sofa"),
        ({"categories": {"chair": None}}, "must be a number"),
        ({"categories": {"chair": 1}}, r"dataset.categories.chair must be in \[2, 100000\]; got 1"),
        ({"views": 4}, "dataset.views"),
        ({"seed": -1}, "dataset.seed must be >= 0; got -1"),
    ],
)
def test_values_out_of_range_are_refused(changes, text):
    with pytest.raises(checks.InputError, match=text):
        _config(**changes)


@pytest.mark.parametrize(("name", "views"), [("smoke", shapenet.NUM_VIEWS), ("cpu", 5), ("paper", shapenet.NUM_VIEWS)])
def test_experiment_files_have_a_valid_section(name, views, pytestconfig):
    section = config.load(pytestconfig.rootpath / "configs" / f"{name}.yaml", "dataset", dataset.DatasetConfig)
    assert section.views == views
    assert (section.source == "shapenet") == (name == "paper")

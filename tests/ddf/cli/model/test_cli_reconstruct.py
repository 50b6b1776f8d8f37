"""`ddf reconstruct`."""

import json
import shutil
import struct
from pathlib import Path
from typing import Any

import _models
import numpy as np
import pytest
import torch
import trimesh
from PIL import Image
from scipy import spatial

import ddf
from ddf.api import reconstruction
from ddf.cli import frame, models
from ddf.core import shipped_models, storage
from ddf.data import cutouts, mesh_topology
from ddf.fields import model_files
from ddf.geometry import mesh_io
from ddf.models import out_of_distribution, reconstruction_models
from ddf.reconstruction import framing, one_image, solid


@pytest.fixture
def model_dir(tmp_path, monkeypatch):
    """An untrained model, whose shape is noise: made coarsely."""
    for module, name, coarse in (
        (one_image, "WHOLE", 400),
        (solid, "_CELLS", 16),
        (reconstruction, "_TOLERANCE", 0.05),
    ):
        monkeypatch.setattr(module, name, coarse)
    return _models.write_model(tmp_path / "model")


@pytest.fixture
def image(tmp_path):
    Image.fromarray(np.random.default_rng(0).integers(1, 255, (60, 90, 4), dtype=np.uint8)).save(tmp_path / "one.png")
    return tmp_path / "one.png"


def test_reconstruct_writes_a_thing(tmp_path, answer):
    out = tmp_path / "out"
    image = shipped_models.ROOT / "plane" / "sample_1.png"
    result = answer("reconstruct", image, "plane", out, "-n", 300)
    names = {"camera.json", "cloud.ply", "model.safetensors", "picture.png", "shape.glb", "shape.ply"}
    assert {file.name for file in out.iterdir()} == names
    points = mesh_io.read_points(out / "cloud.ply")
    whole = ddf.reconstruct(image, "plane").points
    np.testing.assert_allclose(points, whole[:300], atol=1e-5)
    for suffix in (".glb", ".ply"):
        mesh = mesh_topology.clean(mesh_io.load(out / f"shape{suffix}"))  # at seams of the texture corners are twice
        assert mesh_topology.is_watertight(mesh) and len(mesh.faces) == result["faces"] > 0
        np.testing.assert_allclose(np.linalg.norm(np.ptp(mesh.vertices, axis=0)), 1, atol=0.05)  # the frame v1
        away = np.abs(mesh_io.vertex_normals(mesh)).sum(axis=1) > 0
        assert away.mean() > 0.99
    _glb_is_as_viewers_want_it(out, result["faces"])
    field = ddf.load(out)  # patches of the mesh: a ray towards a vertex ends there or before
    start, ends = np.array([3.0, 2.0, 1.0]), mesh.vertices[::50]
    far = np.linalg.norm(ends - start, axis=1)
    found = field.query(np.broadcast_to(start, ends.shape), (ends - start) / far[:, None])["depth"]
    assert (np.abs(found - far)[found > far - 0.02] < 0.01).mean() > 0.8 and (found < far + 0.02).mean() > 0.9
    beside = (points < field.box[0] - 0.03) | (points > field.box[1] + 0.03)  # stray hits, which no mesh has
    assert beside.any(axis=1).mean() < 0.01
    assert json.loads((out / "camera.json").read_text())["camera"] == result["camera"]
    assert json.loads((out / "camera.json").read_text())["verdict"] == result["images"][0]["verdict"]
    assert 0.65 <= result["camera"]["radius"] <= 0.95
    assert 0.8 < result["silhouette_iou"] == result["cameras"][0]["silhouette_iou"] < 1
    assert result["command_seconds"] > sum(result["seconds"].values()) and "picture" in result["seconds"]


def _glb_is_as_viewers_want_it(out, faces):
    given: Any = trimesh.load(out / "shape.ply", process=False)
    data = (out / "shape.glb").read_bytes()
    tree = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
    (drawn,) = tree["meshes"][0]["primitives"]
    place = tree["accessors"][drawn["attributes"]["POSITION"]]
    assert place["componentType"] == 5126 and {"min", "max"} <= set(place)
    assert set(drawn["attributes"]) == {"POSITION", "NORMAL", "TEXCOORD_0"}
    found: Any = trimesh.load(out / "shape.glb", force="mesh", process=False)
    away, near = spatial.cKDTree(given.vertices).query(found.vertices)
    assert len(found.faces) == faces and away.max() < 1e-6 and len(found.vertices) < 1.5 * len(given.vertices)
    np.testing.assert_allclose(np.linalg.norm(found.vertex_normals, axis=1), 1, atol=1e-5)
    material, picture = found.visual.material, np.asarray(found.visual.material.baseColorTexture.convert("RGB"))
    assert material.metallicFactor == 0 and material.roughnessFactor > 0.5
    column, row = (found.visual.uv * [1, -1] + [0, 1]).T * np.array([picture.shape[1::-1]]).T
    painted = picture[row.astype(int), column.astype(int)].astype(int)
    off = np.abs(painted - given.visual.vertex_colors[near, :3]).max(axis=1)
    assert (
        off == 0
    ).mean() > 0.8  # of a corner of triangles that are seen and of such that are not, one colour differs


def test_how_many_points_are_asked_for_changes_no_field():
    image = shipped_models.ROOT / "plane" / "sample_0.png"
    few, usual = (ddf.reconstruct(image, "plane", n=n) for n in (2, 5000))
    assert few.camera == usual.camera and few.points.tolist() == usual.points[:2].tolist()
    assert few.field.framed.field_from_mesh.scale == usual.field.framed.field_from_mesh.scale
    for a, b in zip(few.field.box, usual.field.box, strict=True):
        assert a.tolist() == b.tolist()
    assert 0.95 < np.linalg.norm(np.subtract(*few.field.box)) < 1.2  # of a shape with diagonal 1


def test_several_images_get_a_folder_each(model_dir, image, tmp_path, answer):
    other = shutil.copy(image, tmp_path / "two.png")
    for given, mask, n, told in (
        ([], None, 2, "no picture is given"),
        ([image, other], image, 2, "a mask is of one picture; give one"),
        ([image], None, 1, "n must be a whole number, 2 or more"),
    ):
        with pytest.raises(ValueError, match=told):
            ddf.reconstruct(given, model_dir, n, mask=mask)
    found = answer("reconstruct", image, other, model_dir, tmp_path / "out", "-n", 300)["images"]
    assert [entry["out"] for entry in found] == [(tmp_path / "out" / name).as_posix() for name in ("one", "two")]
    assert (tmp_path / "out" / "two" / "cloud.ply").exists()


def test_the_verdict_is_a_sentence(model_dir, image, monkeypatch):
    path = model_dir / model_files.MODEL
    assert ddf.reconstruct(image, model_dir, n=20).verdict.startswith("the model does not say")
    tensors, record = storage.load_tensors(path, "torch")
    model = reconstruction_models.load_ddf(model_dir).network
    monkeypatch.setattr(framing, "frame", lambda *_: framing.START)
    framed = framing.encoder_input(framing.Cutout(cutouts.read(image)).crop(framing.START, 32))
    near = model.shape_encoder.stages(framed)
    for moved, words in ((0.0, "like the training images"), (1e3, "no model, to judge by the training images")):
        random = torch.Generator().manual_seed(0)
        stages = [each.detach() + moved + torch.randn(400, each.shape[1], generator=random) for each in near]
        found = out_of_distribution.TrainingStatistics.of(stages)
        assert found is not None
        storage.save_tensors(path, tensors, record)
        found.add_to(model_dir)
        assert ddf.reconstruct(image, model_dir, n=20).verdict == words
    assert out_of_distribution.verdict(0.92, "chair") == "unusual: expect errors"
    told = models._rates(Path("plane"))
    assert told == ("so are 3% of 665 planes", "0 to 21% of other things pass too")  # as its card says
    assert models._rates(model_dir) == ("", "")
    made = {"verdict": "V", "unlike_training": 0.97, "cameras": [{"silhouette_iou": 0.9}], "image": "a", "out": "b"}
    made |= {"points": 1, "faces": 1, "camera": {"azimuth_deg": 0.0, "elevation_deg": 0.0, "radius": 1.0}}
    for unlike, by in ((0.97, f"unlike_training 0.97, bound 0.95; {told[0]}"), (0.2, told[1])):
        line = models._line(made | {"unlike_training": unlike}, [image], told)
        assert line.startswith(f"a: V ({by}); seen from 0,0") and "outline" not in line


@pytest.mark.parametrize("command", ["reconstruct", "complete"])
def test_the_model_is_not_replaced_by_what_it_makes(command, model_dir, capsys):
    before = (model_dir / model_files.MODEL).read_bytes()
    (model_dir / "given.png").write_bytes(b"")
    assert frame.main([command, str(model_dir / "given.png"), str(model_dir), str(model_dir)]) == 2
    assert "is read and would be replaced by the output" in capsys.readouterr().err
    assert (model_dir / model_files.MODEL).read_bytes() == before


@pytest.mark.parametrize("command", ["reconstruct", "complete"])
def test_neither_a_fit_nor_the_picture_is_replaced(command, tmp_path, capsys):
    (tmp_path / "picture.png").write_bytes(b"")
    words = [command, str(tmp_path / "picture.png"), "chair", str(tmp_path)]
    assert frame.main(words) == 2
    assert "picture.png is read and would be replaced" in capsys.readouterr().err
    (tmp_path / "fit").mkdir()
    (tmp_path / "fit" / "fit.json").write_text("{}")
    assert frame.main([*words[:-1], str(tmp_path / "fit")]) == 2
    assert "holds the field of a fit; give another folder" in capsys.readouterr().err
    assert [each.name for each in (tmp_path / "fit").iterdir()] == ["fit.json"]

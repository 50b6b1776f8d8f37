import dataclasses
import json

import _models
import numpy as np
import pytest
import torch
from PIL import Image

import ddf
from ddf import cli
from ddf.core import provenance, shipped_models, storage
from ddf.data import cutouts, mesh_topology
from ddf.fields import cloud_projection, model_files, stored_fields
from ddf.geometry import mesh_io
from ddf.models import out_of_distribution, reconstruction_models
from ddf.reconstruction import framing, mask_descent, one_image


@pytest.fixture
def model_dir(tmp_path):
    return _models.write_model(tmp_path / "model")


def _image(path, mode="RGBA", size=(90, 60)):
    pixels = np.random.default_rng(0).integers(1, 255, (size[1], size[0], len(mode)), dtype=np.uint8)
    Image.fromarray(pixels, mode).save(path)
    return path


def test_reconstruct_writes_a_thing(tmp_path, capsys, monkeypatch):
    out, sampled, sample = tmp_path / "out", [], cloud_projection.sample
    monkeypatch.setattr(cloud_projection, "sample", lambda *given: sampled.append(sample(*given)) or sampled[-1])
    image = shipped_models.ROOT / "chair" / "sample_1.png"
    assert cli.main(["reconstruct", "--json", str(image), "chair", str(out), "-n", "300"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert {file.name for file in out.iterdir()} == {
        *("camera.json", "cloud.ply", "model.safetensors", "picture.png", "shape.glb", "shape.ply")
    }
    points = mesh_io.read_points(out / "cloud.ply")
    whole, cloud = cloud_projection.select(sampled[-1], [one_image.WHOLE, 300], stored_fields.cloud_config())
    scale = mask_descent.scale_from_cloud(whole)
    np.testing.assert_allclose(points, scale * cloud.numpy(), atol=1e-5)  # v1: the box of the whole has diagonal 1
    for suffix in (".glb", ".ply"):
        mesh = mesh_io.load(out / f"shape{suffix}")
        assert mesh_topology.is_watertight(mesh) and len(mesh.faces) == result["faces"] > 0
    field = ddf.load(out)
    assert field.framed.field_from_mesh.scale == pytest.approx(1 / scale)
    lower, upper = field.box
    assert (lower <= points + 0.03).all() and (points <= upper + 0.03).all()  # hits may lie beside the cube
    assert json.loads((out / "camera.json").read_text())["camera"] == result["camera"]
    assert 0.65 <= result["camera"]["radius"] <= 0.95


def test_how_many_points_are_asked_for_changes_no_field():
    image = shipped_models.ROOT / "plane" / "sample_0.png"
    few, usual = (ddf.reconstruct(image, "plane", n=n) for n in (2, 5000))
    assert few.camera == usual.camera and few.points.tolist() == usual.points[:2].tolist()
    assert few.field.framed.field_from_mesh.scale == usual.field.framed.field_from_mesh.scale
    for a, b in zip(few.field.box, usual.field.box, strict=True):
        assert a.tolist() == b.tolist()
    assert 0.95 < np.linalg.norm(np.subtract(*few.field.box)) < 1.2  # of a shape with diagonal 1


def _known(path, model_dir, count=3):
    """A file as stage `pointclouds` writes it, of a model."""
    model = reconstruction_models.load_ddf(model_dir).network
    images = torch.rand(count, 4, 32, 32, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        features = model.shape_encoder.stages(images)[-1]
    record = provenance.record("x", 0, [model_dir / model_files.MODEL])
    storage.save_tensors(path / "ddf.safetensors", {"train_features": features}, record)
    return path


def test_with_what_is_known_the_shape_moves_and_the_camera_stays(model_dir, tmp_path, capsys, monkeypatch):
    # without its own descent, which asks the shape that moved
    monkeypatch.setattr(mask_descent, "correct_camera", lambda model, batch, camera, *_: camera)
    image, known = _image(tmp_path / "image.png"), _known(tmp_path / "known", model_dir)
    results, points = [], []
    for name, more in (("plain", []), ("folder", [str(known)]), ("file", [str(known / "ddf.safetensors")])):
        arguments = ["reconstruct", "--json", str(image), str(model_dir), str(tmp_path / name), "-n", "300"]
        assert cli.main([*arguments, *(["--known", *more] if more else [])]) == 0
        results.append(json.loads(capsys.readouterr().out))
        points.append(mesh_io.read_points(tmp_path / name / "cloud.ply"))
    plain, folder, file = results
    assert plain["camera"] == folder["camera"] == file["camera"]
    assert ["silhouette" in result["seconds"] for result in results] == [False, True, True]
    assert np.array_equal(points[1], points[2]) and not np.array_equal(points[0], points[1])


def test_what_is_known_of_another_model_is_refused(model_dir, tmp_path, capsys, monkeypatch):
    image, known = _image(tmp_path / "image.png"), _known(tmp_path / "known", model_dir)
    monkeypatch.setattr(_models, "TRAIN", dataclasses.replace(_models.TRAIN, latent_features=7))
    other = _models.write_model(tmp_path / "other")
    assert cli.main(["reconstruct", str(image), str(other), str(tmp_path / "out"), "--known", str(known)]) == 2
    error = capsys.readouterr().err
    assert "was not made with the model in" in error and "run stage pointclouds" in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda p: _image(p / "x.png", "RGB"), "no object stands out from the background"),
        (lambda p: p / "none.png", "no such image"),
        (lambda p: (p / "x.png").write_bytes(b"\x89PNG\r\n\x1a\n") and p / "x.png", "not a readable image"),
    ],
)
def test_unusable_image_is_one_line_and_exit_2(make, message, model_dir, tmp_path, capsys):
    code = cli.main(["reconstruct", str(make(tmp_path)), str(model_dir), str(tmp_path / "out")])
    error = capsys.readouterr().err
    assert code == 2
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_folder_without_a_ddf_model_is_refused(model_dir, tmp_path, capsys):
    image = _image(tmp_path / "image.png")
    assert cli.main(["reconstruct", str(image), str(tmp_path / "nothing"), str(tmp_path / "out")]) == 2
    tensors, record = storage.load_tensors(model_dir / model_files.MODEL)
    storage.save_tensors(model_dir / model_files.MODEL, tensors, {**record, "kind": "pcsiren"})
    assert cli.main(["reconstruct", str(image), str(model_dir), str(tmp_path / "out")]) == 2
    assert "holds no DDF model" in capsys.readouterr().err


def test_several_images_get_a_folder_each(model_dir, tmp_path, capsys):
    images = [str(_image(tmp_path / f"{name}.png")) for name in ("one", "two")]
    rest = [str(model_dir), str(tmp_path / "out"), "-n", "300"]
    assert cli.main(["reconstruct", "--json", *images, *rest]) == 0
    found = json.loads(capsys.readouterr().out)["images"]
    assert [entry["out"] for entry in found] == [(tmp_path / "out" / name).as_posix() for name in ("one", "two")]
    assert (tmp_path / "out" / "two" / "cloud.ply").exists()
    assert cli.main(["reconstruct", images[0], images[0], *rest]) == 2
    assert "two images are called 'one'" in capsys.readouterr().err


def test_the_verdict_is_a_sentence(model_dir, tmp_path, monkeypatch):
    image, path = _image(tmp_path / "image.png"), model_dir / model_files.MODEL
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
    assert out_of_distribution.verdict(0.95, "chair") == "unusual: expect errors"

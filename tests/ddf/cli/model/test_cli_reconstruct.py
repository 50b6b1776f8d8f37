import dataclasses
import json

import _models
import numpy as np
import pytest
import torch
from PIL import Image

from ddf import cli
from ddf.core import checks, provenance, storage
from ddf.data import shapenet
from ddf.fields import cloud_projection
from ddf.fit import cloud_defaults
from ddf.geometry import point_io
from ddf.models.reconstruction import familiarity, one_image, scales
from ddf.training import training_loop


@pytest.fixture
def model_dir(tmp_path):
    return _models.write_model(tmp_path / "model")


def _image(path, mode="RGBA", size=(90, 60)):
    pixels = np.random.default_rng(0).integers(1, 255, (size[1], size[0], len(mode)), dtype=np.uint8)
    Image.fromarray(pixels, mode).save(path)
    return path


def test_reconstruct_writes_cloud_camera_and_renders(model_dir, tmp_path, capsys, monkeypatch):
    out = tmp_path / "out"
    sampled, sample = [], cloud_projection.sample
    monkeypatch.setattr(cloud_projection, "sample", lambda *given: sampled.append(sample(*given)) or sampled[-1])
    image = _image(tmp_path / "image.png")
    arguments = ["reconstruct", "--json", str(image), str(model_dir), str(out), "-n", "50", "--size", "24"]
    assert cli.main(arguments) == 0
    result = json.loads(capsys.readouterr().out)
    points = point_io.read_points(out / "cloud.ply")
    assert points.shape == (50, 3)
    cycles = sampled[0]
    (cloud,) = cloud_projection.select(cycles, [50], cloud_defaults.cloud())
    scale = scales.scale_from_cloud(cloud)
    np.testing.assert_allclose(
        points, scale * cloud.numpy(), atol=1e-5
    )  # v1 units: the box of the cloud has diagonal 1
    assert result["v1_from_field"]["scale"] == pytest.approx(scale)
    for name in ("visibility", "depth", "normals"):
        with Image.open(out / f"{name}.png") as picture:
            assert picture.size == (24, 24)
    assert json.loads((out / "camera.json").read_text())["camera"] == result["camera"]
    assert 0.7 <= result["camera"]["ratio"] <= 0.9
    assert 0 < result["queries_per_pixel"] < 1


def _known(path, model_dir, count=3):
    """A file as stage `pointclouds` writes it, of a model."""
    model, _ = one_image.load(model_dir)
    images = torch.rand(count, 4, 32, 32, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        features = model.shape_encoder.features(images)
    record = provenance.record("x", 0, [model_dir / training_loop.MODEL])
    storage.save_tensors(path / "ddf.safetensors", {"train_features": features}, record)
    return path


def test_with_what_is_known_the_shape_moves_and_the_camera_stays(model_dir, tmp_path, capsys):
    image, known = _image(tmp_path / "image.png"), _known(tmp_path / "known", model_dir)
    results, points = [], []
    for name, more in (("plain", []), ("folder", [str(known)]), ("file", [str(known / "ddf.safetensors")])):
        arguments = ["reconstruct", "--json", str(image), str(model_dir), str(tmp_path / name), "-n", "50"]
        assert cli.main([*arguments, "--size", "8", *(["--known", *more] if more else [])]) == 0
        results.append(json.loads(capsys.readouterr().out))
        points.append(point_io.read_points(tmp_path / name / "cloud.ply"))
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
        (lambda p: _image(p / "x.png", "RGB"), "must be RGBA, its alpha is the mask of the object; got RGB"),
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
    tensors, record = storage.load_tensors(model_dir / training_loop.MODEL)
    storage.save_tensors(model_dir / training_loop.MODEL, tensors, {**record, "kind": "pcsiren"})
    assert cli.main(["reconstruct", str(image), str(model_dir), str(tmp_path / "out")]) == 2
    assert "holds no DDF model" in capsys.readouterr().err


def test_any_image_is_padded_to_a_square_then_resized(tmp_path):
    pixels = np.full((10, 30, 4), 255, dtype=np.uint8)
    Image.fromarray(pixels, "RGBA").save(tmp_path / "wide.png")
    image = shapenet.read_any_image(tmp_path / "wide.png", 30)
    assert torch.equal(image[3, :, 15] > 0.5, (torch.arange(30) >= 10) & (torch.arange(30) < 20))
    assert bool((image[:3, image[3] == 0] == 0).all())
    Image.fromarray(np.zeros((4, 4, 4), dtype=np.uint8), "RGBA").save(tmp_path / "empty.png")
    with pytest.raises(checks.InputError, match=r"empty.png: is transparent everywhere"):
        shapenet.read_any_image(tmp_path / "empty.png", 30)


def test_several_images_get_a_folder_each(model_dir, tmp_path, capsys):
    images = [str(_image(tmp_path / f"{name}.png")) for name in ("one", "two")]
    rest = [str(model_dir), str(tmp_path / "out"), "-n", "20", "--size", "8"]
    assert cli.main(["reconstruct", "--json", *images, *rest]) == 0
    found = json.loads(capsys.readouterr().out)["images"]
    assert [entry["out"] for entry in found] == [(tmp_path / "out" / name).as_posix() for name in ("one", "two")]
    assert (tmp_path / "out" / "two" / "cloud.ply").exists()
    assert cli.main(["reconstruct", images[0], images[0], *rest]) == 2
    assert "two images are called 'one'" in capsys.readouterr().err


def test_an_image_unlike_those_of_training_is_warned_of(model_dir, tmp_path, capsys):
    image, rest = (
        str(_image(tmp_path / "image.png")),
        [str(model_dir), str(tmp_path / "out"), "-n", "20", "--size", "8"],
    )
    assert cli.main(["reconstruct", image, *rest]) == 0
    assert "the model does not say what its training images were like" in capsys.readouterr().out
    path = model_dir / training_loop.MODEL
    tensors, record = storage.load_tensors(path, "torch")
    model, _ = one_image.load(model_dir)
    near = model.shape_encoder.stages(shapenet.read_any_image(tmp_path / "image.png", 32)[None])
    for moved, warned in ((0.0, False), (1e3, True)):
        random = torch.Generator().manual_seed(0)
        stages = [each.detach() + moved + torch.randn(400, each.shape[1], generator=random) for each in near]
        storage.save_tensors(path, {**tensors, **familiarity.measure(stages)}, record)
        assert cli.main(["reconstruct", image, *rest]) == 0
        assert ("WARNING: unlike" in capsys.readouterr().out) == warned

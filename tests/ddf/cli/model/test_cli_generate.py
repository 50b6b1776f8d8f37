"""`ddf generate`."""

import dataclasses

import _generative
import numpy as np
import pytest
from PIL import Image

import ddf
from ddf.core import storage
from ddf.fields import model_files
from ddf.models import generative_models


def _write(folder, kind):
    record = {"kind": kind, "vae": dataclasses.asdict(_generative.VAE), "gan": dataclasses.asdict(_generative.GAN)}
    model = _generative.image_gan() if kind == generative_models.GAN else _generative.vae()
    storage.save_tensors(folder / model_files.MODEL, dict(model.state_dict()), record)
    return str(folder)


def test_samples_of_an_image_gan_open_as_fields(tmp_path, answer):
    model = _write(tmp_path / "gan", generative_models.GAN)
    found = answer("generate", model, tmp_path / "out", "-n", "2", "--seed", "3")
    assert found["samples"] == ["000", "001"] and found["images"]
    with Image.open(tmp_path / "out/001/image.png") as image, Image.open(tmp_path / "out/001/shape.png") as shape:
        assert image.size == (64, 64) and shape.size == (192, 192)
    field = ddf.load(tmp_path / "out" / "001")
    assert field.query(np.zeros((1, 3)), np.array([[1.0, 0, 0]]), ("visibility",))["visibility"].shape == (1,)
    answer("generate", model, tmp_path / "again", "-n", "1", "--seed", "3")
    first, second = (tmp_path / folder / "000" / model_files.MODEL for folder in ("out", "again"))
    assert first.read_bytes() == second.read_bytes()


def test_a_vae_has_shapes_alone(tmp_path, answer, shown):
    found = answer("generate", _write(tmp_path / "vae", generative_models.VAE), tmp_path / "out", "-n", "2")
    assert not found["images"] and not (tmp_path / "out/000/image.png").exists()
    assert (tmp_path / "out/000/shape.png").exists()
    page = tmp_path / "samples.html"
    shown("view", *(tmp_path / "out" / name for name in found["samples"]), page)
    assert "<title>000, 001</title>" in page.read_text()


def test_shapes_of_a_reconstruction_model_are_its_prior(tmp_path, answer):
    two, one = ddf.generate("chair", 2, seed=5), ddf.generate("chair", 1, seed=5)
    assert np.array_equal(two[0].points(50), one[0].points(50))
    assert not np.array_equal(two[0].points(50), two[1].points(50))
    assert np.linalg.norm(np.ptp(two[1].points(500), axis=0)) == pytest.approx(1, rel=0.1)  # v1
    answer("generate", "chair", tmp_path, "-n", "1", "--seed", "5")
    assert np.array_equal(ddf.load(tmp_path / "000").points(50), one[0].points(50))

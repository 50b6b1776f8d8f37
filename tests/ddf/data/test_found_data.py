"""Images and folders as people have them: turned, huge, without a silhouette; beside what computers leave behind."""

import logging
import os
import resource

import numpy as np
import pytest
from PIL import Image

from ddf.core import checks
from ddf.data import cutouts, dataset, shapenet


def _picture(width=40, height=30):
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 256, (height, width, 4)).astype(np.uint8)
    pixels[..., 3] = np.where(np.indices((height, width)).sum(0) < 40, 255, 0)
    return Image.fromarray(pixels)


@pytest.mark.parametrize(
    ("tag", "undo"),
    [(3, Image.Transpose.ROTATE_180), (6, Image.Transpose.ROTATE_90), (8, Image.Transpose.ROTATE_270)],
)
def test_photographs_are_turned_as_their_exif_says(tmp_path, tag, undo):
    exif = Image.Exif()
    exif[0x0112] = tag
    _picture().save(tmp_path / "plain.png")
    _picture().transpose(undo).save(tmp_path / "turned.png", exif=exif)
    plain, turned = (cutouts.read(tmp_path / f"{name}.png") for name in ("plain", "turned"))
    assert np.array_equal(plain, turned)


@pytest.mark.real
def test_kept_pictures_are_the_same_and_the_strip_is_bounded(shared_dir):
    cases = shared_dir / "cases"
    turned, base = (cutouts.read(cases / f"{name}.png") for name in ("exif6", "base"))
    assert np.array_equal(turned, base)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert max(cutouts.read(cases / "strip16k.png").shape) == 1024
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400 * 1024


def test_long_strips_keep_their_place_in_bounded_memory(tmp_path):
    strip = np.zeros((40, 16000, 4), np.uint8)
    strip[:, :8000] = (255, 0, 0, 255)
    Image.fromarray(strip).save(tmp_path / "strip.png")
    image = cutouts.read(tmp_path / "strip.png")
    assert image.shape == (3, 1024, 4) and (image[:, 514:] == 0).all() and image[:, :510, 3].min() > 0


def test_images_of_too_many_pixels_are_refused_before_they_are_read(tmp_path):
    Image.new("RGBA", (7200, 7200)).save(tmp_path / "large.png")
    with pytest.raises(checks.InputError, match=r"large\.png: 7200 x 7200 pixels; at most 50000000"):
        cutouts.read(tmp_path / "large.png")


def test_hidden_colours_are_zero(tmp_path):
    _picture(137, 137).save(tmp_path / "native.png")
    for image in (
        shapenet.read_image(tmp_path / "native.png", 137).permute(1, 2, 0),
        cutouts.read(tmp_path / "native.png"),
    ):
        assert (image[image[..., 3] == 0] == 0).all() and (image[..., 3] == 0).any()


def test_junk_of_computers_is_passed_over_and_the_unknown_is_named(tmp_path, caplog):
    root = tmp_path / "my data ~1"
    for name in ("03001627/a", "03001627/.ipynb_checkpoints", "__MACOSX/03001627", "@eaDir/x", ".Trash/y"):
        (root / "ShapeNetRendering" / name).mkdir(parents=True)
    with caplog.at_level(logging.WARNING):
        assert shapenet.list_classes(root) == ["03001627"]
        assert shapenet.list_shapes(root, "03001627") == ["a"]
    assert "passed over .Trash, @eaDir, __MACOSX" in caplog.text
    (root / "ShapeNetRendering" / "backup").mkdir()
    with pytest.raises(checks.InputError, match="ShapeNetRendering/backup: not a synset"):
        shapenet.list_classes(root)


NESTED = (
    "ShapeNetRendering/ShapeNetRendering",
    "ShapeNetRendering/03001627/03001627",
    "ShapeNetCore.v1/ShapeNetCore.v1",
    "ShapeNetCore.v1/03001627/03001627",
)


@pytest.mark.parametrize("nested", NESTED)
def test_folders_that_are_nested_twice_are_refused_by_name(tmp_path, monkeypatch, nested):
    for name in ("ShapeNetRendering/03001627/a", "ShapeNetCore.v1/03001627/a", nested):
        (tmp_path / name).mkdir(parents=True, exist_ok=True)
    monkeypatch.setenv("DDF_DATA", str(tmp_path))
    section = dataset.DatasetConfig("shapenet", {"chair": None}, 0, 24, False)
    with pytest.raises(checks.InputError, match=f"{nested}: nested twice; move what it holds one folder up"):
        dataset.list_real(section, dataset.real_root(os.environ))


def test_broken_images_are_refused_in_one_line(tmp_path):
    good = tmp_path / "good.png"
    _picture().save(good)
    data, rng = good.read_bytes(), np.random.default_rng(0)
    for i in range(200):
        broken = bytearray(data)
        for place in rng.integers(0, len(broken), 3):
            broken[place] = rng.integers(0, 256)
        path = tmp_path / "broken.png"
        path.write_bytes(bytes(broken[: rng.integers(1, len(broken) + 1)]) if i % 2 else bytes(broken))
        try:
            cutouts.read(path)
        except checks.InputError as fault:
            assert str(fault).startswith(str(path))

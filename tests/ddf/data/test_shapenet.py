"""Data in the layout of ShapeNet: images, cameras, folders and the index; what is wrong in them is named."""

import json
import logging

import numpy as np
import pytest
import torch
from _support import assert_close
from PIL import Image

from ddf.core import checks
from ddf.data import shapenet

CHAIR = "03001627"


def _disc(seed=0):
    """An opaque disc of random colours, on a transparent ground that hides others."""
    y, x = np.mgrid[:137, :137]
    pixels = np.random.default_rng(seed).integers(0, 256, (137, 137, 4)).astype(np.uint8)
    pixels[..., 3] = np.where((x - 68) ** 2 + (y - 68) ** 2 < 40**2, 255, 0)
    return pixels


def test_image_is_read_as_it_is(tmp_path):
    pixels = _disc()
    Image.fromarray(pixels).save(tmp_path / "00.png")
    image = shapenet.read_image(tmp_path / "00.png", 137)
    pixels[pixels[..., 3] == 0] = 0
    assert image.dtype == torch.float32
    assert_close(image, np.moveaxis(pixels, -1, 0).astype(np.float32) / 255, atol=1e-7)


def test_resized_image_keeps_area_and_colour(tmp_path):
    pixels = _disc()
    pixels[pixels[..., 3] > 0] = (200, 100, 50, 255)
    Image.fromarray(pixels).save(tmp_path / "00.png")
    for size in (128, 64, 32):
        image = shapenet.read_image(tmp_path / "00.png", size)
        assert image.shape == (4, size, size)
        assert_close(image[3].mean(), pixels[..., 3].mean() / 255, atol=2e-3)
        # Weighted by alpha: the empty surroundings do not darken the rim.
        rim = image[3] > 0.05
        assert_close(image[:3, rim].T, np.broadcast_to(np.array([200, 100, 50]) / 255, (int(rim.sum()), 3)), atol=0.06)
        assert (image[:3, image[3] == 0] == 0).all()


def _message(call, *arguments):
    with pytest.raises(checks.InputError) as caught:
        call(*arguments)
    return str(caught.value)


def test_bad_images_are_named(tmp_path):
    path = tmp_path / "00.png"
    Image.fromarray(_disc()).save(path)
    data = path.read_bytes()
    half = len(data) // 2
    flipped = data[:half] + bytes([data[half] ^ 0xFF]) + data[half + 1 :]
    for broken in (data[:half], data[20:], b"", flipped):
        path.write_bytes(broken)
        assert _message(shapenet.read_image, path, 64).startswith(f"{path}: not a readable PNG")
    Image.fromarray(_disc()[..., :3]).save(path)
    assert _message(shapenet.read_image, path, 64).startswith(f"{path}: must be RGBA, its alpha is the mask")
    Image.fromarray(_disc()[:100]).save(path)
    assert _message(shapenet.read_image, path, 64).startswith(f"{path}: must be 137 x 137")
    path.unlink()
    assert "no such image" in _message(shapenet.read_image, path, 64)


def test_cameras_are_read_row_by_row(tmp_path):
    (tmp_path / "rendering_metadata.txt").write_text("293.4 27.9 0 0.79 25\n-10 -90 0 1e0 25\r\n0 90 0 0.65 25\n\n")
    expected = [[293.4, 27.9, 0.79], [-10, -90, 1], [0, 90, 0.65]]
    assert_close(shapenet.read_cameras(tmp_path), np.array(expected), atol=1e-12)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("1 2 0 0.7", "five numbers"),
        ("1 2 0 0.7 25 6", "five numbers"),
        ("", "five numbers"),
        ("1 x 0 0.7 25", "five numbers"),
        ("1 91 0 0.7 25", "elevation must be"),
        ("1 25 0 0 25", "ratio > 0"),
        ("nan 25 0 0.7 25", "finite"),
        ("1 25 0 inf 25", "finite"),
    ],
)
def test_bad_metadata_lines_are_named_with_their_number(tmp_path, line, text):
    path = tmp_path / "rendering_metadata.txt"
    path.write_text(f"1 25 0 0.7 25\n{line}\n1 25 0 0.7 25\n")
    message = _message(shapenet.read_cameras, tmp_path)
    assert message.startswith(f"{path}:2: ") and text in message and repr(line) in message


def test_binary_metadata_and_missing_and_empty_folders_are_named(tmp_path):
    (tmp_path / "rendering_metadata.txt").write_bytes(b"\xff\xfe\x00")
    assert "not a text file" in _message(shapenet.read_cameras, tmp_path)
    assert f"{tmp_path / 'no'}: no such folder" in _message(shapenet.list_shapes, tmp_path / "no", CHAIR)
    (tmp_path / "ShapeNetRendering").mkdir()
    assert "has no classes" in _message(shapenet.list_classes, tmp_path)
    (tmp_path / "ShapeNetRendering" / CHAIR).mkdir()
    assert "has no shapes" in _message(shapenet.list_shapes, tmp_path, CHAIR)


@pytest.mark.parametrize("name", ["..", "../x", "a/../../x", "/etc", "a\\b", ""])
def test_no_id_leads_out_of_its_folder(tmp_path, name):
    for call in (shapenet.model_path, shapenet.rendering_dir):
        for synset, shape in ((CHAIR, name), (name, "abc")):
            assert "letters, digits" in _message(call, tmp_path, synset, shape)
    index = {"root": str(tmp_path), "categories": {"chair": {"synset": CHAIR, "shapes": []}}}
    index["categories"]["chair"]["shapes"] = [{"id": name, "train_views": [0], "test_views": []}]
    (tmp_path / "index.json").write_text(json.dumps(index))
    assert "index.json" in _message(shapenet.Dataset.open, tmp_path / "index.json")


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


@pytest.mark.parametrize("text", ["[]", "{}", '{"root": "x", "categories": {"chair": {}}}', "{"])
def test_damaged_index_is_named(tmp_path, text):
    (tmp_path / "index.json").write_text(text)
    assert "index.json" in _message(shapenet.Dataset.open, tmp_path / "index.json")

"""Committed pictures of the fields that come with the package are of those fields as they are."""

import itertools
import json
import runpy
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

from ddf.pictures import picture_strips
from ddf_lab.engine import publish

ROOT = Path(__file__).resolve().parents[2]


def test_the_picture_of_the_readme_shows_the_shipped_fields():
    with Image.open(ROOT / "docs" / "fields.webp") as picture:
        told = json.loads(picture.info["xmp"])
    assert told == publish.shipped("field"), "run: python docs/fields.py"


def test_ten_pictures_show_the_shipped_fields():
    file = ROOT / "docs" / "ten.webp"
    with Image.open(file) as picture:
        told, pixels = json.loads(picture.info["xmp"]), np.asarray(picture.convert("RGB"))
    assert told == publish.shipped("field"), "run: python docs/ten.py"
    assert file.stat().st_size < 1.5e6
    side, step = 280, 280 + picture_strips.GAP
    tops = [picture_strips.TEXT + picture_strips.NAME + line * (step + picture_strips.NAME) for line in range(2)]
    cells = [pixels[top : top + side, left * step :][:, :side].astype(int) for top in tops for left in range(5)]
    assert all((cell < 235).any(axis=-1).mean() > 0.1 for cell in cells)  # what is shown fills its cell
    assert min(np.abs(a - b).mean() for a, b in itertools.combinations(cells, 2)) > 5


def test_the_reconstructions_are_of_the_shipped_models():
    file = ROOT / "docs" / "reconstructed.webp"
    with Image.open(file) as picture:
        told, pixels = json.loads(picture.info["xmp"]), np.asarray(picture.convert("RGB")).astype(int)
    assert told == publish.shipped("reconstruction"), "run: python docs/reconstructed.py"
    title, side = 30, pixels.shape[1] // 12
    lines = (pixels.shape[0] - title) // side
    cells = pixels[title:].reshape(lines, side, 12, side, 3).transpose(0, 2, 1, 3, 4).reshape(-1, 4, side, side, 3)
    drawn = (cells < 235).any(axis=-1).mean(axis=(2, 3))
    assert ((drawn > 0.02).all(axis=1) | (drawn == 0).all(axis=1)).all()  # whole shapes, or none in the last line
    assert (drawn > 0.02).all(axis=1).sum() == 12 + 12 + 10


def test_the_moving_picture_of_the_readme_shows_these_meshes():
    with Image.open(ROOT / "docs" / "turning.webp") as picture:
        told = json.loads(picture.info["xmp"])
        assert (
            len(list(ImageSequence.Iterator(picture))) > 12 and (ROOT / "docs" / "turning.webp").stat().st_size < 1.5e6
        )
    found = runpy.run_path(str(ROOT / "docs" / "turning.py"))["checksum"]()
    assert told == {"meshes": found}, "run: python docs/turning.py"


def test_the_figures_show_the_shipped_fields():
    told = json.loads((ROOT / "reports" / "figures" / publish.INPUTS).read_text())
    assert told == publish.shipped("field"), "run: make figures, then make publish CONFIG=configs/figures.yaml"

"""Committed pictures of the fields that come with the package are of those fields as they are."""

import json
import runpy
from pathlib import Path

from PIL import Image, ImageSequence

from ddf_lab.report import publish

ROOT = Path(__file__).resolve().parents[2]


def test_the_picture_of_the_readme_shows_the_shipped_fields():
    with Image.open(ROOT / "docs" / "fields.webp") as picture:
        told = json.loads(picture.info["xmp"])
    assert told == publish.shipped_fields(), "run: python docs/fields.py"


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
    assert told == publish.shipped_fields(), "run: make figures, then make publish CONFIG=configs/figures.yaml"

"""Committed pictures of what comes with the package are of it as it is."""

import json
import runpy
from pathlib import Path

import pytest
from PIL import Image

from ddf_lab.engine import publish

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("name", "kind"), [("fields", "field"), ("ten", "field"), ("reconstructed", "reconstruction"), ("turning", "")]
)
def test_pictures_show_the_shipped_models_and_are_small(name, kind):
    file = ROOT / "docs" / f"{name}.webp"
    with Image.open(file) as picture:
        told = json.loads(picture.info["xmp"])
    shown = (
        publish.shipped(kind) if kind else {"meshes": runpy.run_path(str(ROOT / "docs" / f"{name}.py"))["checksum"]()}
    )
    assert told == shown, f"run: python docs/{name}.py"
    assert file.stat().st_size < 1.5e6


def test_the_figures_show_the_shipped_fields():
    told = json.loads((ROOT / "reports" / "figures" / publish.INPUTS).read_text())
    assert told == publish.shipped("field"), "run: make figures, then make publish CONFIG=configs/figures.yaml"

"""Live fields of the gallery."""

import base64
import re
import runpy
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]


def test_the_gallery_names_the_live_fields_and_writes_them(tmp_path):
    gallery = runpy.run_path(str(ROOT / "docs" / "gallery.py"))
    named = re.findall(r"(?m)^- `([\w-]+)`: ", (ROOT / "docs" / "gallery.md").read_text())
    assert tuple(named) == gallery["NAMES"] and len(named) == 9
    gallery["write"](tmp_path, ("rabbit",))
    picture = (tmp_path / "rabbit.webp").read_bytes()
    assert base64.b64encode(picture) in (tmp_path / "rabbit.html").read_bytes()
    with Image.open(tmp_path / "rabbit.webp") as shown:
        assert 0.05 < (np.asarray(shown.convert("RGBA"))[..., 3] > 127).mean() < 0.9

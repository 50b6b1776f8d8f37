"""The site's menu has every page, or `make docs` stops with a warning."""

import base64
import re
import runpy
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("*.md", "docs/*.md", "examples/*.md")  # those of reports/ need no place in the menu


def _named(menu):
    for entry in menu:
        for target in entry.values():
            if isinstance(target, str):
                yield target
            else:
                yield from _named(target)


def test_the_menu_has_every_page_once_and_no_other():
    named = list(_named(yaml.safe_load((ROOT / "mkdocs.yml").read_text())["nav"]))
    assert len(named) == len(set(named)) and all((ROOT / name).is_file() for name in named)
    pages = {str(page.relative_to(ROOT)) for pattern in PAGES for page in ROOT.glob(pattern)}
    assert pages == {name for name in named if not name.startswith("reports/")}


def test_the_gallery_names_the_live_fields_and_writes_them(tmp_path):
    gallery = runpy.run_path(str(ROOT / "docs" / "gallery.py"))
    named = re.findall(r"(?m)^- `([\w-]+)`: ", (ROOT / "docs" / "gallery.md").read_text())
    assert tuple(named) == gallery["NAMES"] and len(named) == 8
    gallery["write"](tmp_path, ("rabbit",))
    picture = (tmp_path / "rabbit.webp").read_bytes()
    assert base64.b64encode(picture) in (tmp_path / "rabbit.html").read_bytes()
    with Image.open(tmp_path / "rabbit.webp") as shown:
        assert 0.05 < (np.asarray(shown.convert("RGBA"))[..., 3] > 127).mean() < 0.9

"""Committed pictures of what comes with the package are of it as it is; live fields of the gallery; what
hooks mend in the site."""

import base64
import json
import re
import runpy
import sys
from pathlib import Path
from unittest import mock

import numpy as np
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


def test_the_gallery_names_the_live_fields_and_writes_them(tmp_path):
    gallery = runpy.run_path(str(ROOT / "docs" / "gallery.py"))
    named = re.findall(r"(?m)^- `([\w-]+)`: ", (ROOT / "docs" / "gallery.md").read_text())
    assert tuple(named) == gallery["NAMES"] and len(named) == 9
    gallery["write"](tmp_path, ("rabbit",))
    picture = (tmp_path / "rabbit.webp").read_bytes()
    assert base64.b64encode(picture) in (tmp_path / "rabbit.html").read_bytes()
    with Image.open(tmp_path / "rabbit.webp") as shown:
        assert 0.05 < (np.asarray(shown.convert("RGBA"))[..., 3] > 127).mean() < 0.9


def test_pages_name_their_dialog_have_no_empty_header_and_underline_links(monkeypatch):
    known = ("latex2mathml", "mkdocs.config.defaults", "mkdocs.structure.files", "mkdocs.structure.pages")
    for name in known:  # `make site` brings them
        monkeypatch.setitem(sys.modules, name, mock.Mock())
    monkeypatch.setitem(sys.modules, "griffe", mock.Mock(Extension=object))
    hooks = runpy.run_path(str(ROOT / "docs" / "site_files.py"))
    theme = "<input {}><input {}><div {}>".format(*reversed(hooks["NAMED"]))
    for page in (hooks["on_post_template"](theme, "404.html"), hooks["named"](theme)):
        assert 'role="dialog" aria-label="Search"' in page and page.count("aria-label") == 3
    with pytest.raises(LookupError, match="mend NAMED"):
        hooks["named"](theme.replace("dialog", "search"))
    table = '<tr><th style="a"> </th><th>b</th></tr>'
    assert hooks["on_page_content"](table) == '<tr><td style="a"></td><th>b</th></tr>'
    style = (ROOT / "docs" / "site.css").read_text()
    assert re.search(r"(?m)^\.md-typeset a:not\([^)]*\) \{ text-decoration: underline;", style)

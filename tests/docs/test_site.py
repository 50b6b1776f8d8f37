"""Live fields of the gallery, and what the site's hooks mend in its pages."""

import base64
import re
import runpy
import sys
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
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

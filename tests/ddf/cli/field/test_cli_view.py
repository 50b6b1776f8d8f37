"""`ddf view`: a page."""

import json
import re
from pathlib import Path

import pytest

from ddf.core import shipped_models

ROW = {"field": 1, "rabbit, field, rabbit": 3}  # the page's title, and how many fields stand side by side


@pytest.mark.parametrize("title", ROW)
def test_the_page_is_written(title, fitted, tmp_path, answer):
    out = tmp_path / "page.html"
    fields = [fitted[0] if name == "field" else name for name in title.split(", ")]
    assert answer("view", *fields, out)["bytes"] == out.stat().st_size and f"<title>{title}</title>" in out.read_text()
    (record,) = re.findall(r'id="ddf-page">(.*?)</script>', out.read_text())
    places = [field["world_from_mesh"]["translation"][2] for field in json.loads(record)["fields"]]
    assert len(places) == ROW[title] and (title == "field" or places[0] > places[2])  # of the rabbits


def test_a_scene_holds_each_field_once(tmp_path, answer):
    (tmp_path / "two.yaml").write_text("objects: [{field: rabbit}, {field: rabbit, translation: [1, 0, 0]}]")
    one, two = (answer("view", what, tmp_path / "page.html")["bytes"] for what in ("rabbit", tmp_path / "two.yaml"))
    assert abs(two - one) < 20_000  # a field has 190,000; first pictures differ


def test_without_a_file_the_browser_is_asked(fitted, answer, monkeypatch):
    asked = []
    monkeypatch.setattr("webbrowser.open", lambda address: asked.append(address) or True)
    result = answer("view", fitted[0])
    assert result["opened"] and asked == [Path(result["out"]).as_uri()] and Path(result["out"]).is_file()


def test_a_picture_before_a_model_becomes_patches(tmp_path, answer):
    image = shipped_models.place("car") / "sample_1.png"
    found = answer("view", image, "car", tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text()
    assert found["fields"] == ["car"] and found["bytes"] < 500_000
    assert "What the model car makes of sample_1.png: " in text and '"kind":"patches"' in text

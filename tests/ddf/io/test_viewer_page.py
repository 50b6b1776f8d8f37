"""The viewer's page: one file, nothing outside it; built from the sources beside it."""

import base64
import gzip
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from _support import assert_close

from ddf.cli import views
from ddf.core import checks, shipped_models
from ddf.io import viewer_page

SOURCES = Path(__file__).resolve().parents[3] / "viewer"
SVG = "http://www.w3.org/2000/svg"  # the name of a namespace, which nothing loads
LARGEST = 3_000_000  # bytes of a page with a field of 5 layers of 128


@pytest.fixture(scope="module")
def page() -> viewer_page.Page:
    return views.page_of([shipped_models.place("rabbit-network")])


@pytest.fixture(scope="module")
def text(page) -> str:
    return viewer_page.render(page).decode()


def _element(text: str, name: str) -> str:
    (found,) = re.findall(rf'<script type="[^"]*" id="{name}">(.*?)</script>', text, re.DOTALL)
    return found


def test_the_page_may_load_nothing(text):
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy is not None and policy[1].startswith("default-src 'none'")
    assert not re.search(r"https?:|@import", text.replace(policy[0], "").replace(SVG, ""))
    loaded = re.findall(r'<(?:script|link|img|iframe)\b[^>]*?(?:src|href)="([^"]*)"', text)
    assert [address.partition(",")[0] for address in loaded] == ["data:", "data:image/webp;base64"]


def test_the_weights_are_in_the_page_which_is_small_and_the_same_each_time(text, page):
    assert len(text) < LARGEST and viewer_page.render(page).decode() == text
    data = gzip.decompress(base64.b64decode(_element(text, "ddf-weights")))
    assert_close(np.frombuffer(data, np.float32), page.fields[0].numbers)


def test_a_title_cannot_end_its_element(page):
    odd = viewer_page.Page("</title><b>", "</script>", page.corners, page.fields)
    text = viewer_page.render(odd).decode()
    assert "&lt;/title&gt;&lt;b&gt;" in text and json.loads(_element(text, "ddf-page"))["about"] == "</script>"


def test_pages_of_nothing_and_of_files_without_weights_are_refused(tmp_path):
    (tmp_path / "field.onnx").write_bytes(b"")
    (tmp_path / "model.safetensors").symlink_to(shipped_models.place("chair") / "model.safetensors")
    for call, error in (
        (lambda: viewer_page.field(tmp_path / "field.onnx"), "folder"),
        (lambda: views.page_of([tmp_path]), "sample_0"),
    ):
        with pytest.raises(checks.InputError, match=error):
            call()
    with pytest.raises(FileNotFoundError):
        viewer_page.field(tmp_path / "nothing")


@pytest.mark.browser
def test_the_built_template_is_that_of_the_sources(tmp_path):
    node = shutil.which("node")
    if node is None or not (SOURCES / "node_modules").is_dir():
        pytest.skip("needs node and the packages of viewer/: make viewer")
    subprocess.run([node, SOURCES / "node_modules/typescript/bin/tsc", "--noEmit"], cwd=SOURCES, check=True)
    subprocess.run([node, "build.mjs", tmp_path], cwd=SOURCES, check=True)
    assert (tmp_path / "page.html").read_bytes() == viewer_page.TEMPLATE.read_bytes(), "run make viewer"

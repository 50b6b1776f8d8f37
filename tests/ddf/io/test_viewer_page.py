"""The viewer's page: one file, nothing outside it; built from the sources beside it."""

import base64
import dataclasses
import gzip
import json
import re
import shutil
import subprocess
from pathlib import Path

import _models
import numpy as np
import pytest
import torch
from _support import assert_close

from ddf.core import checks, shipped_models
from ddf.io import onnx_file, onnx_graphs, onnx_parity, viewable, viewer_page
from ddf.models import out_of_distribution

SOURCES = Path(__file__).resolve().parents[3] / "viewer"
SVG = "http://www.w3.org/2000/svg"  # the name of a namespace, which nothing loads
LARGEST = 3_000_000  # bytes of a page with a field of 5 layers of 128


@pytest.fixture(scope="module")
def page() -> viewer_page.Page:
    return viewable.page(shipped_models.place("rabbit"))


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
    assert re.findall(r'<(?:script|link|img|iframe)\b[^>]*?(?:src|href)="([^"]*)"', text) == ["data:,"]


def test_the_weights_are_in_the_page_which_is_small_and_the_same_each_time(text, page):
    assert len(text) < LARGEST and viewer_page.render(page).decode() == text
    data = gzip.decompress(base64.b64decode(_element(text, "ddf-weights")))
    assert_close(np.frombuffer(data, np.float32), page.fields[0].numbers)


def test_a_title_cannot_end_its_element(page):
    odd = viewer_page.Page("</title><b>", "</script>", page.corners, page.fields)
    text = viewer_page.render(odd).decode()
    assert "&lt;/title&gt;&lt;b&gt;" in text and json.loads(_element(text, "ddf-page"))["about"] == "</script>"


def test_pages_of_nothing_and_of_files_without_weights_are_refused(tmp_path):
    (tmp_path / "model.safetensors").symlink_to(shipped_models.place("chair") / "model.safetensors")
    for call, error in (
        (lambda: viewable.page(shipped_models.place("rabbit") / "field.onnx"), "folder"),
        (lambda: viewable.page(tmp_path), "sample_0"),
        (lambda: viewable.side_by_side("row", []), "one field"),
        (lambda: viewer_page.together([]), "one field"),
    ):
        with pytest.raises(checks.InputError, match=error):
            call()
    with pytest.raises(FileNotFoundError):
        viewable.page(tmp_path / "nothing")


def test_encoders_in_the_page_are_those_of_the_model():
    model = _models.ddf_model()
    with torch.no_grad():
        known = out_of_distribution.TrainingStatistics.of(model.shape_encoder.stages(torch.rand(8, 4, 32, 32)))
    for graph, more in (
        (onnx_graphs.ModulationsGraph(model, 32), set()),
        (onnx_graphs.ModulationsGraph(model, 32, known), {"distance"}),
    ):
        rows = onnx_parity.compare(onnx_file.to_onnx(graph, {}), "modulations", graph, (1, 3), 0)
        onnx_parity.require(rows)
        assert {row.output for row in rows} == {"camera", "modulations"} | more


def test_a_page_with_encoders_holds_the_runtime(page):
    encoders = viewer_page.Encoders(b"graph", 32, [b"picture"], 0.8, True)
    text = viewer_page.render(dataclasses.replace(page, encoders=encoders)).decode()
    assert gzip.decompress(base64.b64decode(_element(text, "ddf-model"))) == b"graph"
    assert gzip.decompress(base64.b64decode(_element(text, "ddf-runtime")))[:4] == b"\0asm"
    assert json.loads(_element(text, "ddf-page"))["model"]["samples"] == ["data:image/png;base64,cGljdHVyZQ=="]


@pytest.mark.browser
def test_the_built_template_is_that_of_the_sources(tmp_path):
    node = shutil.which("node")
    if node is None or not (SOURCES / "node_modules").is_dir():
        pytest.skip("needs node and the packages of viewer/: make viewer")
    subprocess.run([node, SOURCES / "node_modules/typescript/bin/tsc", "--noEmit"], cwd=SOURCES, check=True)
    subprocess.run([node, "build.mjs", tmp_path], cwd=SOURCES, check=True)
    for built in tmp_path.iterdir():
        unpack = gzip.decompress if built.suffix == ".gz" else bytes
        kept = (viewer_page.BUILT / built.name).read_bytes()
        assert unpack(built.read_bytes()) == unpack(kept), f"{built.name}: run make viewer"


def test_licences_name_the_versions_that_are_built():
    pinned = json.loads((SOURCES / "package.json").read_text())["devDependencies"]
    notes = (viewer_page.BUILT / "LICENCES.md").read_text()
    assert f"| {pinned['onnxruntime-web']} |" in notes and f"esbuild {pinned['esbuild']} " in notes

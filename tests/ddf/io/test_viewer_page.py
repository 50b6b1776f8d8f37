"""The viewer's page: one file, nothing outside it, built from the sources beside it; fields as it holds them."""

import base64
import dataclasses
import gzip
import itertools
import json
import re
import shutil
import subprocess
from pathlib import Path

import _models
import numpy as np
import pytest
import torch
from _shapes import icosphere
from _support import assert_close

from ddf.cli import views
from ddf.core import checks, shipped_models
from ddf.fields import field_file, pddf, shape_field
from ddf.fields.grid import octree, patch_field
from ddf.fit import fit_folder
from ddf.geometry import transforms
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
    with pytest.raises(checks.InputError, match="folder"):
        viewer_page.field(tmp_path / "field.onnx")
    with pytest.raises(checks.InputError, match="sample_0"):
        views.page_of([tmp_path])
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


def _field():
    torch.manual_seed(0)
    return pddf.PDDF(pddf.PDDFConfig((8, 12), 3.0, 2.0, "softplus", 100.0))


def _shape(folder, field):
    shape = shape_field.ShapeField(field, -np.ones(3), np.ones(3), transforms.Similarity(2.0), {})
    return field_file.read(shape.save(folder))


def _plain(baked, inputs):
    """The network as the page evaluates it: W sin(... sin(W_1 x + b_1)) + b."""
    widths, at, states = baked.record["widths"], 0, inputs
    for index, (columns, rows) in enumerate(itertools.pairwise(widths)):
        weight = baked.numbers[at : at + rows * columns].reshape(rows, columns)
        at += rows * columns
        states = states @ weight.T + baked.numbers[at : at + rows]
        at += rows
        states = np.sin(states) if index < len(widths) - 2 else states
    assert at == len(baked.numbers)
    return states


def test_frequencies_and_modulations_are_baked_in(tmp_path):
    generator = torch.Generator().manual_seed(1)
    field, inputs = _field(), torch.randn(5, 6, generator=generator)
    modulations = [0.5 + torch.rand(1, width, generator=generator) for width in field.config.hidden]
    expected = field.network(inputs, modulations)
    baked = _shape(tmp_path, pddf.baked(field, modulations))
    assert_close(_plain(viewer_page.bake(baked, "one"), inputs.numpy()), expected)
    assert (expected - field.network(inputs)).abs().max() > 0.1


def test_several_fields_share_a_block_and_one_that_stands_twice_is_there_once(tmp_path):
    one, two = (viewer_page.bake(_shape(tmp_path, _field()), "f") for _ in range(2))
    records, numbers = viewer_page.together([one, two, viewer_page.placed(one, transforms.Similarity(3.0))])
    count = len(one.numbers)
    assert [record["offset"] for record in records] == [0, count, 0] and len(numbers) == 2 * count
    assert_close(numbers[count:], two.numbers)
    assert records[2]["world_from_mesh"]["scale"] == 3.0


def test_patches_are_in_the_block_as_in_their_file():
    arrays, record = patch_field.fitted(*fit_folder.in_cube(icosphere(2)), octree.PatchConfig(depth=1))
    field = patch_field.of(arrays, record)
    baked = viewer_page.bake(field, "ball")
    counts, data = {name: baked.record[name] for name in ("codes", "bends", "cells")}, baked.numbers.tobytes()
    assert counts == {name: len(arrays[name]) for name in counts} and counts["bends"] > 0
    assert baked.record["kind"] == "patches" and baked.record["tolerance"] == field.tolerance
    for name in ("codes", "planes", "bends", "cells"):  # those of two bytes first
        raw = arrays[name].tobytes()
        assert data.startswith(raw)
        data = data[len(raw) :]
    assert len(data) < 4


@pytest.fixture
def shapes(tmp_path):
    """A field, and one ten times as large that stands elsewhere."""
    one = field_file.read(_models.write_shape_field(tmp_path / "one"))
    other = transforms.Similarity(0.002, np.eye(3), np.array([7.0, -2.0, 1.0]))
    return one, dataclasses.replace(one, field_from_mesh=other)


@pytest.mark.parametrize(("up", "height", "right"), [("y", 1, [0, 0, -1]), ("z", 2, [0, 1, 0])])
def test_a_row_stands_on_one_floor_as_large_as_the_first(shapes, up, height, right):
    page = viewer_page.side_by_side("row", [("small", shapes[0]), ("large", shapes[1])], up)
    places = [transforms.Similarity.from_dict(field.record["world_from_mesh"]) for field in page.fields]
    first, second = (place.apply(viewer_page.corners(shape)) for place, shape in zip(places, shapes, strict=True))
    side = np.ptp(viewer_page.corners(shapes[0]), axis=0)
    assert_close(np.ptp(first, axis=0), side)
    assert_close(np.ptp(second, axis=0), side)
    assert_close((second @ right).min() - (first @ right).max(), np.array(viewer_page.GAP * side.max()))
    for box in (first, second):
        assert_close(box[:, height].min(), np.array(0.0), atol=1e-12)
        assert_close(box[:, 0].min(), -box[:, 0].max())
    both = np.concatenate([first, second])
    assert_close(page.corners.min(axis=0), both.min(axis=0))
    assert_close(page.corners.max(axis=0), both.max(axis=0))

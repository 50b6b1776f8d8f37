"""Every script of examples/ and the cells of its notebook run, at small sizes."""

import dataclasses
import json
import re
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import ddf
from ddf.fit import completion

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "examples"
NOTEBOOK = json.loads((FOLDER / "tour.ipynb").read_text())
PYRAMID = "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 2 0\nf 1 2 3 4\nf 2 1 5\nf 3 2 5\nf 4 3 5\nf 1 4 5\n"


def _run(folder: Path, script: str, *arguments: str) -> str:
    command = [sys.executable, str(FOLDER / script), *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.timeout(600)  # seconds of training behind a minute of a busy core
def test_fit_a_mesh(tmp_path):
    (tmp_path / "pyramid.obj").write_text(PYRAMID)
    said = _run(tmp_path, "fit_a_mesh.py", "pyramid.obj", "field", "--minutes", "0.1", "--rays", "50")
    assert re.fullmatch(r"visibility is right for [\d.]+ % of the rays\n", said)
    assert (tmp_path / "field" / "model.safetensors").is_file()


def test_render_it(tmp_path):
    _run(tmp_path, "render_it.py", "rabbit", "rabbit.png", "--size", "32")
    picture = np.asarray(Image.open(tmp_path / "rabbit.png"))
    assert picture.shape == (32, 32)
    assert 0.15 < (picture < 255).mean() < 0.9 and picture[0, 0] == 255
    assert len(np.unique(picture)) > 30


@pytest.fixture
def here(tmp_path, monkeypatch, capsys):
    """Runs a script in this process, where a test may have changed sizes: what it prints."""

    def run(script: str, *arguments: str) -> str:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr("sys.argv", [script, *arguments])
        runpy.run_path(str(FOLDER / script), run_name="__main__")
        return capsys.readouterr().out

    return run


def test_recover_pose(here, monkeypatch):
    monkeypatch.setattr(completion, "_KNOWN", dataclasses.replace(completion._KNOWN, draws=64, starts=2))
    said = here("recover_pose.py", "--turn", "5", "--shift", "0.05")
    angle, shift = map(float, re.findall(r"\d+\.\d+", said))
    assert angle < 1 and shift < 0.01


SAID = {  # by scripts that print a few numbers: which are right
    "fit_a_latent.py": lambda before, unseen, after, last: after < 0.1 * before and last < 0.1 * unseen,
    "pose_in_a_loop.py": lambda turn, shift, angle, off: turn > 10 and shift > 0.1 and angle < 0.5 and off < 0.01,
    "light_from_shadows.py": lambda before, after: before > 2 and after < 0.2,
    "depth_renderer.py --steps 3 --images 24": lambda depth, off: 0 < depth < 1 and 0 < off < 2,
}


@pytest.mark.timeout(600)
@pytest.mark.parametrize("line", SAID)
def test_numbers(line, tmp_path):
    said = _run(tmp_path, *line.split())
    assert SAID[line](*map(float, re.findall(r"\d+\.\d+", said))), said


def test_reconstruct_an_image(tmp_path):
    said = _run(tmp_path, "reconstruct_an_image.py", "chair.npz", "--points", "100")
    with np.load(tmp_path / "chair.npz") as found:
        points = found["points"]
    assert points.shape == (100, 3)
    assert 0.2 < np.ptp(points, axis=0).max() < 1.2  # the diagonal of a ShapeNet shape is about 1
    assert re.search(r"azimuth_deg .*elevation_deg .*radius \d", said)


@pytest.mark.parametrize(
    "line, said",
    [
        ("complete_a_scan.py --scan no.npz", "No such file .*no.npz"),
        ("fit_a_mesh.py notes.txt field", "notes.txt: mesh files must end in"),
        ("onnx_without_torch.py", "arguments are required: field"),
        ("onnx_without_torch.py no.onnx", "no.onnx: no such file"),
        ("own_shapenet.py no lists", "no: no such folder"),
        ("reconstruct_an_image.py no/chair.npz", "No such file .*'no'"),
        ("reconstruct_an_image.py chair.npz --image no.png", "no.png: no such image"),
        ("recover_pose.py --field no", "no: no such file or folder"),
        ("render_it.py rabbit no/rabbit.png", "No such file .*'no'"),
    ],
)
def test_a_path_that_is_wrong_is_told_in_one_line(line, said, here, tmp_path, capsys):
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(SystemExit, match=r"^2$"):
        here(*line.split())
    assert re.search(rf"(?m)^{line.split()[0]}: error: .*{said}.*\n\Z", capsys.readouterr().err)


def test_onnx_without_torch(tmp_path):
    said = _run(tmp_path, "onnx_without_torch.py", str(ddf.load("rabbit-network").export(tmp_path / "rabbit.onnx")))
    depths = [float(depth) for depth in re.findall(r"depth +([\w.]+)", said)]
    assert len(depths) == 7 and 3 <= np.isfinite(depths).sum()
    assert min(depths) >= 0.99  # the rays start one unit before the box


@pytest.mark.usefixtures("quick_completion")
def test_complete_a_scan(here, tmp_path):
    said = here("complete_a_scan.py", "--beams", "32")
    seen, inferred, explained = (int(each) for each in re.findall(r": (\d+)%", said))
    assert seen + inferred in (99, 100, 101) and seen > 10 and explained > 20
    assert (tmp_path / "whole_chair" / "model.safetensors").is_file()


def test_own_shapenet(tmp_path):
    for shape in ("a10", "a9"):
        (tmp_path / "root" / "ShapeNetRendering" / "03001627" / shape / "rendering").mkdir(parents=True)
    said = _run(tmp_path, "own_shapenet.py", "root", "lists")
    assert said == "train: 8 views of 1 classes\ntest: 2 views of 1 classes\n"
    lines = (tmp_path / "lists" / "test_list.txt").read_text().splitlines()
    assert lines == [f"Data/ShapeNetP2M/03001627/a10/rendering/{view:02d}.dat" for view in (3, 4)]


@pytest.mark.timeout(600)
def test_notebook_runs_cell_by_cell(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {"__name__": "__main__"}
    cells = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]
    for cell in cells:
        exec(compile("".join(cell["source"]), cell["id"], "exec"), namespace)
    assert namespace["found"].points.shape == (200, 3) and len(cells) >= 6

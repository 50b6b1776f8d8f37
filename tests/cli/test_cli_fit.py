"""`ddf fit`, `query`, `render` and `points` end to end on a tiny field; bad input is one line and exit code 2."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
import yaml
from _shapes import moved, torus
from PIL import Image

from ddf import cli
from ddf.core import config
from ddf.geometry import mesh_io, point_io
from ddf.shape import fit_settings, fitting, shape_field

TINY = {
    "mesh": None,
    "field": {
        "hidden": [16, 16],
        "omega_first": 3.0,
        "omega_hidden": 1.0,
        "depth_activation": "softplus",
        "depth_sharpness": 100.0,
    },
    "steps": 5,
    "minutes": None,
    "samples": dict.fromkeys("UABSTO", 200),
    "held_out": dict.fromkeys("UABSTO", 100),
    "batch": dict.fromkeys("UABSTOE", 20),
    "weights": {
        "depth": 5.0,
        "depth_of": "mixture",
        "depth_huber": None,
        "visibility": 1.0,
        "normals": 10.0,
        "weight_variance": 1.0,
        "eikonal_depth": 0.05,
        "eikonal_visibility": 0.01,
        "transition": 0.25,
        "visibility_variance": 0.0,
        "transition_speed": 1.0,
    },
    "epsilon_o": 0.05,
    "box": "tight",
    "margin": 0.02,
    "start": "flat",
    "loop": {
        "learning_rate": 1e-3,
        "schedule": "cosine",
        "warmup_steps": 2,
        "clip_norm": None,
        "threads": 1,
        "seed": 0,
        "log_every": 5,
        "checkpoint_seconds": 100.0,
    },
    "page": {"picture_size": 12, "up": "y", "rays": 50},
    "ablation": {"samples": 600, "held_out": 50, "steps": 3, "minutes": None},
}
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def work(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fit")
    mesh = moved(torus(sections=16), 30.0, (100.0, 0.0, -50.0))
    (folder / "torus.ply").write_bytes(mesh_io.ply_bytes(mesh, double=True))
    (folder / "tiny.yaml").write_text(yaml.safe_dump({"fit": TINY}))
    return folder


@pytest.fixture(scope="module")
def fitted(work):
    """Folder of a field, and what `ddf fit --json` said."""
    arguments = ["fit", str(work / "torus.ply"), str(work / "field"), "--config", str(work / "tiny.yaml")]
    assert cli.main([*arguments, "--seed", "3"]) == 0
    return work / "field", json.loads((work / "field" / fitting.METRICS).read_text())


def _rays(path, **arrays):
    np.savez(path, **arrays)
    return path


def test_fit_says_what_scripts_rely_on(work, capsys):
    arguments = ["fit", "--json", str(work / "torus.ply"), str(work / "json"), "--config", str(work / "tiny.yaml")]
    assert cli.main([*arguments, "--steps", "3"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert set(result["held_out"]["depth_l1"]) == set("UABSTO")
    assert set(result["held_out"]["visibility_bce"]) == set("UABSTO")
    assert result["held_out"]["normal_angle_deg_median"] > 0
    assert result["seconds"] > 0
    assert result["parameters"] == 6 * 16 + 16 + 16 * 16 + 16 + 16 * 4 + 4
    assert result["steps"] == 3


def test_fit_writes_field_log_and_metrics(fitted):
    folder, metrics = fitted
    assert {path.name for path in folder.iterdir()} >= {"model.safetensors", "log.csv", "fit.json"}
    assert metrics["steps"] == 5
    record = shape_field.load(folder).record
    assert record["seed"] == 3
    assert list(record["sources"]) == ["torus.ply"]
    assert record["field_from_mesh"]["scale"] == pytest.approx((1 - TINY["margin"]) / 30)


def test_minutes_take_about_that_long(work, capsys):
    arguments = ["fit", "--json", str(work / "torus.ply"), str(work / "timed"), "--config", str(work / "tiny.yaml")]
    assert cli.main([*arguments, "--minutes", "0.03"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["steps"] >= 10
    assert (work / "timed" / fitting.PLAN).exists()


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--steps", "0"], "fit.steps must be >= 1 or null; got 0"),
        (["--minutes", "-1"], "fit.minutes must be > 0 or null; got -1.0"),
        (["--minutes", "nan"], "fit.minutes must be > 0 or null; got nan"),
        (["--seed", "-1"], "seed must be >= 0; got -1"),
        (["--config", "none.yaml"], "No such file or directory: none.yaml"),
    ],
)
def test_bad_fits_are_one_line_and_exit_2(work, extra, message, capsys):
    assert cli.main(["fit", str(work / "torus.ply"), str(work / "bad"), *extra]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (work / "bad").exists()


def test_bad_meshes_and_folders_are_one_line_and_exit_2(work, capsys):
    (work / "empty.obj").write_text("v 0 0 0\n")
    for mesh, out in (("none.obj", "x"), ("empty.obj", "x"), ("torus.ply", "tiny.yaml")):
        assert cli.main(["fit", str(work / mesh), str(work / out)]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_query_answers_in_the_frame_of_the_mesh(work, fitted, capsys):
    centre = np.array([100.0, 0.0, -50.0])
    starts = centre + np.array([[0.0, 60.0, 0.0], [0.0, 60.0, 0.0], [21.0, 0.0, 0.0], [6e4, 0.0, 0.0]])
    along = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    path = _rays(work / "rays.npz", positions=starts, directions=along)
    arguments = ["query", "--json", str(fitted[0]), "--rays", str(path), "--out", str(work / "out.npz")]
    assert cli.main([*arguments, "--outputs", ",".join(shape_field.OUTPUTS)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["rays"], result["evaluated"], result["saved"]) == (4, 3, 1)
    with np.load(work / "out.npz") as found:
        assert set(found.files) == set(shape_field.OUTPUTS)
        assert found["depth"].shape == (4,)
        assert found["normals"].shape == (4, 3)
        assert np.isinf(found["depth"][1])
        assert found["visibility"][1] == 0
        seen = np.isfinite(found["depth"])
        assert np.array_equal(seen, found["visibility"] >= 0.5)
        assert not any(np.isnan(found[name]).any() for name in found.files)


@pytest.mark.parametrize(
    ("arrays", "outputs", "message"),
    [
        (
            {"positions": np.zeros((2, 3)), "directions": np.array([[0, 0, 1.0], [0, 0, 2]])},
            "depth",
            "must be unit length (tol 0.0001); got 2 at index",
        ),
        ({"positions": np.zeros((2, 3))}, "depth", "has no array 'directions'"),
        ({"positions": np.full((1, 3), np.nan), "directions": np.eye(3)[:1]}, "depth", "positions must be finite"),
    ],
)
def test_bad_rays_are_one_line_and_exit_2(work, fitted, arrays, outputs, message, capsys):
    path = _rays(work / "bad.npz", **arrays)
    out = work / "never.npz"
    code = cli.main(["query", str(fitted[0]), "--rays", str(path), "--out", str(out), "--outputs", outputs])
    error = capsys.readouterr().err
    assert code == 2
    assert message in error
    assert error.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(("outputs", "message"), [("colour", "must be among visibility, "), ("", "got nothing")])
def test_unknown_outputs_are_one_line_and_exit_2(fitted, outputs, message, capsys):
    with pytest.raises(SystemExit) as caught:
        cli.main(["query", str(fitted[0]), "--rays", "no.npz", "--out", "never.npz", "--outputs", outputs])
    assert caught.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("ddf query: error: argument --outputs: must be among") and message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("output", shape_field.OUTPUTS)
def test_render_writes_a_picture(work, fitted, output, capsys):
    out = work / f"{output}.png"
    arguments = ["render", "--json", str(fitted[0]), str(out), "--size", "24", "--output", output]
    assert cli.main([*arguments, "--camera=-30,20,1.0", "--up", "z"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert 0 < result["evaluated"] < 24 * 24
    assert result["evaluated"] + result["saved"] == 24 * 24
    with Image.open(out) as picture:
        assert picture.size == (24, 24)
        assert picture.mode == "RGB"


def test_refined_render_evaluates_fewer_rays(work, fitted, capsys):
    results = {}
    for extra in ((), ("--refine", "0.01")):
        out = work / f"refined{len(extra)}.png"
        assert cli.main(["render", "--json", str(fitted[0]), str(out), "--size", "65", *extra]) == 0
        results[extra] = json.loads(capsys.readouterr().out)
        with Image.open(out) as picture:
            assert picture.size == (65, 65)
    whole, refined = results.values()
    assert refined["evaluated"] < 0.8 * whole["evaluated"]
    assert refined["saved"] == 65 * 65 - refined["evaluated"]
    assert abs(refined["seen"] - whole["seen"]) < 0.1 * 65 * 65


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--camera", "1,2"], "three numbers"),
        (["--camera", "a,b,c"], "three numbers"),
        (["--size", "0"], "size must be"),
        (["--size", "0", "--refine", "0.1"], "size must be"),
        (["--refine", "-1"], "tolerance must be >= 0"),
        (["--refine", "0.1", "--output", "normals"], "--refine goes with --output depth alone; got normals"),
    ],
)
def test_bad_renders_are_one_line_and_exit_2(work, fitted, extra, message, capsys):
    assert cli.main(["render", str(fitted[0]), str(work / "never.png"), *extra]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_points_are_in_the_frame_of_the_mesh(work, fitted, capsys):
    out = work / "cloud.ply"
    arguments = ["points", "--json", str(fitted[0]), str(out), "-n", "50", "--cycles", "1", "--directions", "8"]
    assert cli.main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["points"] == 50
    points = point_io.read_points(out)
    assert points.shape == (50, 3)
    assert np.abs(points - np.array([100.0, 0.0, -50.0])).max() < 300
    assert cli.main([*arguments[:4], "-n", "0"]) == 2
    assert cli.main([*arguments[:4], "--cycles", "0"]) == 2


def test_something_else_than_a_field_is_refused(work, fitted, capsys):
    assert cli.main(["render", str(work / "nothing"), str(work / "never.png")]) == 2
    assert "no such field; give a folder that `ddf fit` wrote" in capsys.readouterr().err
    damaged = work / "damaged"
    damaged.mkdir()
    data = bytearray((fitted[0] / "model.safetensors").read_bytes())
    data[-5] ^= 1
    (damaged / "model.safetensors").write_bytes(data)
    assert cli.main(["render", str(damaged), str(work / "never.png")]) == 2
    assert "is damaged" in capsys.readouterr().err


def test_stage_fits_the_mesh_of_the_config_or_a_procedural_chair(work, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = runpy.run_path(str(ROOT / "stages" / "fit_shape.py"))["run"]
    sources = []
    for mesh in (None, str(work / "torus.ply")):
        Path("tiny.yaml").write_text(yaml.safe_dump({"fit": {**TINY, "mesh": mesh}}))
        run(Path("tiny.yaml"))
        sources.append(shape_field.load(tmp_path / "artifacts" / "tiny" / "fit_shape").record["sources"])
    assert sources[0] == {}
    assert list(sources[1]) == ["torus.ply"]


def test_default_config_file_is_the_default_of_the_command():
    assert config.load(ROOT / "configs" / "fit.yaml", fit_settings.FitConfig) == fit_settings.DEFAULT

"""`ddf fit` end to end on a tiny field; bad input is one line and exit code 2."""

import json
import runpy
from pathlib import Path

import pytest
import yaml
from _tiny_fits import SECTION

from ddf import cli
from ddf.cli import fields
from ddf.core import config
from ddf.fields import pddf, shape_field
from ddf.fit import fit_settings, fitting, inspection
from ddf_lab.run import Run

ROOT = Path(__file__).resolve().parents[4]


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


def test_a_finished_fit_is_not_measured_again(work, capsys, monkeypatch):
    (work / "tetrahedron.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    said = []
    for _ in range(2):
        assert cli.main(["fit", str(work / "tetrahedron.obj"), str(work / "twice"), "--tolerance", "0.01"]) == 0
        said.append(capsys.readouterr().out.splitlines())
        monkeypatch.setattr(inspection, "measure", None)
    assert said[0][:-1] == said[1][:-1] and "fitted already" in said[1][-1]


def test_fit_writes_field_log_and_metrics(fitted):
    folder, metrics = fitted
    assert {path.name for path in folder.iterdir()} >= {"model.safetensors", "log.csv", "fit.json"}
    assert metrics["steps"] == 5
    record = shape_field.load(folder).record
    assert record["seed"] == 3
    assert list(record["sources"]) == ["torus.ply"]
    assert record["field_from_mesh"]["scale"] == pytest.approx((1 - fit_settings.FitConfig().margin) / 30)


def test_minutes_take_about_that_long_and_few_steps_are_said(work, capsys):
    arguments = ["fit", str(work / "torus.ply"), str(work / "timed"), "--config", str(work / "tiny.yaml")]
    assert cli.main([*arguments, "--minutes", "0.02"]) == 0
    verdict = capsys.readouterr().out.splitlines()[-1]
    steps = json.loads((work / "timed" / fitting.METRICS).read_text())["steps"]
    assert steps >= 1 and ("FEWER than 500 steps" in verdict) == (steps < 500)


@pytest.mark.parametrize(
    ("asked", "timed", "load", "limit", "threads"),
    [
        (None, True, 0.2, "", 2),  # idle
        (None, True, 7.0, "", 1),  # busy
        (None, False, 7.0, "", 2),  # by steps: part of the result
        (None, False, 0.0, "1", 1),
        (3, True, 7.0, "1", 3),
    ],
)
def test_threads_are_those_asked_for_allowed_and_idle(asked, timed, load, limit, threads, monkeypatch):
    monkeypatch.setattr(fields.os, "getloadavg", lambda: (load, 0, 0))
    monkeypatch.setattr(fields.os, "cpu_count", lambda: 4)
    monkeypatch.setenv("OMP_NUM_THREADS", limit)
    assert fields.threads_of(2, asked, timed) == threads


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--steps", "0"], "steps must be >= 1; got 0"),
        (["--minutes", "-1"], "minutes must be > 0; got -1.0"),
        (["--minutes", "nan"], "minutes must be > 0; got nan"),
        (["--seed", "-1"], "seed must be >= 0; got -1"),
        (["--config", "none.yaml"], "none.yaml: no such file, nor the name of one"),
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


def test_stage_fits_the_mesh_of_the_config_or_a_procedural_chair(work, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make = runpy.run_path(str(ROOT / "stages" / "fit_shape.py"))["make"]
    sources = []
    for mesh in (None, str(work / "torus.ply")):
        Path("tiny.yaml").write_text(yaml.safe_dump({"fit": {**SECTION, "mesh": mesh}}))
        make(Run.read("tiny.yaml"))
        sources.append(shape_field.load(tmp_path / "artifacts" / "tiny" / "fit_shape").record["sources"])
    assert sources[0] == {}
    assert list(sources[1]) == ["torus.ply"]


def test_fits_are_known_by_name():
    found = {path.stem: config.load(path, "fit", fit_settings.FitConfig) for path in config.PACKAGED.glob("*.yaml")}
    assert found["fit"] == fit_settings.FitConfig()
    assert found["long_fit"].minutes == 19.0 and found["long_fit"].loop.ema is None
    assert found["paper_fit"].field == pddf.PAPER_SINGLE_SHAPE


def test_what_the_reader_left_out_is_said(work, capsys):
    text = (work / "torus.ply").with_name("half.obj")
    text.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2\nf 1 3 4\nf 1 2 4\nf 2 3 4\n")
    arguments = ["fit", str(text), str(work / "half"), "--config", str(work / "tiny.yaml"), "--steps", "1"]
    assert cli.main(arguments) == 0
    assert capsys.readouterr().out.rstrip().endswith("of the file: 1 faces of fewer than three corners are left out")

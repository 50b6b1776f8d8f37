"""`ddf fit` end to end on a tiny field."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
import yaml
from _tiny_fits import SECTION

import ddf
from ddf import cli
from ddf.cli import fields
from ddf.fields import shape_field
from ddf.fit import fit_folder, fit_settings, inspection
from ddf_lab.run import Run

ROOT = Path(__file__).resolve().parents[4]
CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"


def test_fit_writes_field_log_and_metrics(fitted):
    folder, metrics = fitted
    assert {path.name for path in folder.iterdir()} >= {"model.safetensors", "log.csv", "fit.json"}
    record = shape_field.load(folder).record
    assert (metrics["steps"], record["seed"], list(record["sources"])) == (5, 3, ["torus.ply"])
    assert record["field_from_mesh"]["scale"] == pytest.approx((1 - fit_settings.FitConfig().margin) / 30)
    held_out = metrics["held_out"]
    assert set(held_out["depth_l1"]) == set(held_out["visibility_bce"]) == set("UABSTO")
    assert held_out["normal_angle_deg_median"] > 0 and metrics["seconds"] > 0
    assert metrics["parameters"] == 6 * 16 + 16 + 16 * 16 + 16 + 16 * 4 + 4


def test_a_finished_fit_is_not_measured_again(tmp_path, shown, monkeypatch):
    (tmp_path / "tetrahedron.obj").write_text(f"{CORNERS}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    said = []
    for _ in range(2):
        said.append(shown("fit", tmp_path / "tetrahedron.obj", tmp_path / "twice", "--tolerance", "0.01"))
        monkeypatch.setattr(inspection, "measure", None)
    assert said[0][:-1] == said[1][:-1] and "fitted already" in said[1][-1]


def test_pictures_have_up_what_the_fit_was_told(tmp_path, shown):
    (tmp_path / "tetrahedron.obj").write_text(f"{CORNERS}f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    shown("fit", tmp_path / "tetrahedron.obj", tmp_path / "told", "--tolerance", "0.01", "--up", "z")
    depths = []
    for up in ((), ("--up", "z"), ("--up", "y")):
        shown("render", tmp_path / "told", tmp_path / "depth.npz", "--size", 16, *up)
        with np.load(tmp_path / "depth.npz") as file:
            depths.append(file["depth"])
    assert np.array_equal(depths[0], depths[1]) and not np.array_equal(depths[0], depths[2])
    np.testing.assert_allclose(ddf.load(tmp_path / "told").render(size=16)["depth"], depths[0], rtol=1e-6)


def test_minutes_take_about_that_long_and_few_steps_are_said(work, capsys):
    words = ("fit", work / "torus.ply", work / "timed", "--config", work / "tiny.yaml", "--minutes", 0.02)
    code, verdict = cli.main([*map(str, words)]), capsys.readouterr().out.splitlines()[-1]
    steps = json.loads((work / "timed" / fit_folder.METRICS).read_text())["steps"]
    assert steps >= 1 and ("FEWER than 500 steps" in verdict) == (code == 1) == (steps < 500)


@pytest.mark.parametrize(
    ("timed", "load", "limit", "threads"),
    [
        (True, 0.2, "", 2),  # idle
        (True, 7.0, "", 1),  # busy
        (False, 7.0, "", 2),  # by steps: part of the result
        (False, 0.0, "1", 1),
    ],
)
def test_threads_are_those_that_are_allowed_and_idle(timed, load, limit, threads, monkeypatch):
    monkeypatch.setattr(fields.os, "getloadavg", lambda: (load, 0, 0))
    monkeypatch.setattr(fields.os, "cpu_count", lambda: 4)
    monkeypatch.setenv("OMP_NUM_THREADS", limit)
    assert fields.threads_of(2, timed) == threads


def test_stage_fits_the_mesh_of_the_config_or_a_procedural_chair(work, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make = runpy.run_path(str(ROOT / "stages" / "fit_shape.py"))["make"]
    for mesh, sources in ((None, []), (str(work / "torus.ply"), ["torus.ply"])):
        Path("tiny.yaml").write_text(yaml.safe_dump({"fit": {**SECTION, "mesh": mesh}}))
        make(Run.read("tiny.yaml"))
        assert list(shape_field.load(tmp_path / "artifacts" / "tiny" / "fit_shape").record["sources"]) == sources

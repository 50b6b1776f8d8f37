"""`ddf surface`: the mesh and its scores; bad input is one line and exit code 2."""

import json

import numpy as np
import pytest

from ddf import cli
from ddf.data.synthetic import showcase
from ddf.geometry import mesh_io


def test_a_mesh_with_its_scores(tmp_path, capsys):
    (tmp_path / "truth.ply").write_bytes(mesh_io.ply_bytes(showcase.rabbit()))
    arguments = ["surface", "rabbit", str(tmp_path / "m.ply"), "--method", "udf", "--resolution", "48"]
    assert cli.main([*arguments, "--truth", str(tmp_path / "truth.ply"), "--json"]) == 0
    result, mesh = json.loads(capsys.readouterr().out), mesh_io.load(tmp_path / "m.ply")
    assert result["faces"] == len(mesh.faces) > 2000 and result["vertices"] == len(mesh.vertices)
    assert result["chamfer_l1"] < 0.03 and result["normal_consistency"] > 0.85
    assert np.abs(mesh.vertices).max() < 1.6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rabbit", "m.xyz"], "mesh files must end in one of .obj, .ply, .stl, .off, .glb; got .xyz"),
        (["rabbit", "m.ply", "--method", "cubes"], "invalid choice"),
        (["rabbit", "m.ply", "--resolution", "2"], "whole number, 8 to 256"),
        (["rabbit", "m.ply", "--truth", "absent.obj"], "absent.obj"),
        (["hare", "m.ply"], "hare: no such file"),
        (["rabbit", "none/m.ply"], "there is no folder"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(arguments, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    try:
        code = cli.main(["surface", *arguments])
    except SystemExit as stopped:
        code = stopped.code
    error = capsys.readouterr().err
    assert code == 2 and message in error and error.count("\n") == 1 and not (tmp_path / "m.ply").exists()

"""`ddf points`: a cloud with normals in the frame of the mesh."""

import json
import re
from pathlib import Path

import numpy as np

from ddf import cli
from ddf.data.synthetic import showcase
from ddf.geometry import mesh_io, raycast

ROOT = Path(__file__).resolve().parents[4]


def _table(path):
    """The six columns of a PLY with normals, as the header names them."""
    data = path.read_bytes()
    header, _, body = data.partition(b"end_header\n")
    names = re.findall(rb"property float (\w+)", header)
    return [name.decode() for name in names], np.frombuffer(body, "<f4").reshape(-1, len(names)).astype(np.float64)


def test_points_are_in_the_frame_of_the_mesh(work, fitted, capsys):
    out = work / "cloud.ply"
    arguments = ["points", "--json", str(fitted[0]), str(out), "-n", "50", "--cycles", "1", "--directions", "8"]
    assert cli.main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["points"] == 50
    points = mesh_io.read_points(out)
    assert points.shape == (50, 3)
    assert np.abs(points - np.array([100.0, 0.0, -50.0])).max() < 300
    assert cli.main([*arguments[:4], "-n", "0"]) == 2
    assert cli.main([*arguments[:4], "--cycles", "0"]) == 2


def test_points_of_a_shipped_field_have_its_normals_and_say_so(tmp_path, capsys):
    """The rabbit: a smooth closed surface. A step along the normal leaves it, one against it goes inside."""
    out = tmp_path / "cloud.ply"
    assert cli.main(["points", "--json", "rabbit", str(out), "-n", "200"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["normals"].startswith("field ") and result["normals"].endswith("rabbit")
    names, table = _table(out)
    assert names == ["x", "y", "z", "nx", "ny", "nz"] and len(table) == 200
    lengths = np.linalg.norm(table[:, 3:], axis=1)
    assert np.abs(lengths[lengths > 0] - 1).max() < 1e-5 and (lengths == 0).sum() == result["without_normal"] < 10
    truth = raycast.Scene(showcase.rabbit())
    known = table[lengths > 0]
    away = np.mean(truth.outside(known[:, :3] + 0.05 * known[:, 3:]))
    into = np.mean(truth.outside(known[:, :3] - 0.05 * known[:, 3:]))
    assert away > 0.95 and into < 0.05
    assert np.array_equal(mesh_io.read_points(out), table[:, :3])


def test_points_may_come_without_normals(work, fitted, capsys):
    arguments = ["points", str(fitted[0]), str(work / "bare.ply"), "-n", "50", "--cycles", "1", "--no-normals"]
    assert cli.main(arguments) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("50 points without normals in ")
    assert _table(work / "bare.ply")[0] == ["x", "y", "z"]

"""`ddf cast` end to end."""

import json

import numpy as np
import pytest
from _shapes import cube, moved, random_rays
from _support import assert_close

from ddf import cli
from ddf.geometry import mesh_io


def test_cast_answers_in_the_frame_of_the_file(tmp_path, capfd):
    shift = np.array([2.0**18, -(2.0**19), 2.0**17])
    path, rays_path, out = tmp_path / "cube.ply", tmp_path / "rays.npz", tmp_path / "hits.npz"
    path.write_bytes(mesh_io.export_bytes(moved(cube(), 4.0, tuple(shift)), ".ply"))
    directions = random_rays(300, seed=1).directions.numpy().astype(np.float32)
    positions = np.tile(shift, (300, 1)).astype(np.float32)
    np.savez(rays_path, positions=positions, directions=directions)
    assert cli.main(["cast", str(path), "--rays", str(rays_path), "--out", str(out), "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["hits"] == 300
    with np.load(out) as hits:
        assert set(hits.files) == {"depth", "visible", "normals"} and hits["visible"].all()
        assert_close(hits["depth"], 4.0 / np.abs(directions).max(axis=1), atol=1e-5)
        assert_close(np.abs(hits["normals"]).max(axis=1), np.ones(300))
        assert ((hits["normals"] * directions).sum(axis=1) < 0).all()


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["cast", "{soup}", "--rays", "{none}", "--out", "{out}.npz"], "none"),
        (["cast", "{soup}", "--rays", "{soup}", "--out", "{out}.npz"], "not a readable NPZ"),
    ],
)
def test_bad_input_is_one_line_and_code_two(arguments, reason, refuses):
    refuses(arguments, reason)


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"positions": np.zeros((2, 3))}, "no array 'directions'"),
        ({"positions": np.zeros((2, 3)), "directions": np.zeros((2, 2))}, "shape"),
        ({"positions": np.zeros((2, 3)), "directions": np.full((2, 3), 2.0)}, "unit length"),
        ({"positions": np.full((1, 3), np.nan), "directions": np.array([[0, 0, 1.0]])}, "finite"),
        ({"positions": np.zeros((1, 3)), "directions": np.zeros((3, 3))}, "1 positions but 3 directions"),
        ({"positions": np.array(["a"]), "directions": np.zeros((1, 3))}, "numbers"),
        ({"positions": np.zeros((3_000_000, 3), np.int8), "directions": np.zeros((1, 3))}, "claims 9,000,000 numbers"),
    ],
)
def test_cast_refuses_bad_rays(arrays, reason, soup, tmp_path, capfd):
    np.savez_compressed(tmp_path / "rays.npz", **arrays)
    assert cli.main(["cast", str(soup), "--rays", str(tmp_path / "rays.npz"), "--out", str(tmp_path / "h.npz")]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and reason in error and "rays.npz" in error


def test_cast_takes_no_rays(soup, tmp_path):
    np.savez(tmp_path / "rays.npz", positions=np.zeros((0, 3)), directions=np.zeros((0, 3)))
    assert cli.main(["cast", str(soup), "--rays", str(tmp_path / "rays.npz"), "--out", str(tmp_path / "h.npz")]) == 0
    with np.load(tmp_path / "h.npz") as hits:
        assert hits["depth"].shape == (0,)

"""`ddf mesh`, `ddf cast` and `ddf samples` end to end."""

import json

import numpy as np
import pytest
from _shapes import cube, icosphere, joined, moved, random_rays
from _support import assert_close

from ddf import cli
from ddf.core import storage
from ddf.data import mesh_topology
from ddf.geometry import mesh_io, transforms

MESH_KEYS = {"watertight", "faces", "hausdorff", "mean_distance", "seconds", "transform"}


@pytest.fixture
def soup(tmp_path):
    """Two overlapping parts far from the origin."""
    mesh = moved(joined(moved(cube(), 0.5, (0.4, 0, 0)), moved(icosphere(3), 0.6, (-0.3, 0, 0))), 7.0, (1e4, 0, -1e4))
    path = tmp_path / "soup.ply"
    path.write_bytes(mesh_io.export_bytes(mesh, ".ply"))
    return path


def test_mesh_writes_a_closed_mesh_in_the_field_frame(soup, tmp_path, capfd):
    out = tmp_path / "closed.obj"
    assert cli.main(["mesh", str(soup), str(out), "--faces", "500", "--alpha", "0.05", "--json"]) == 0
    answer = json.loads(capfd.readouterr().out)
    assert answer.keys() >= MESH_KEYS and answer["watertight"] is True and answer["faces"] <= 500
    mesh = mesh_io.load(out)
    assert len(mesh.faces) == answer["faces"] and mesh_topology.is_watertight(mesh)
    lower, upper = mesh.box()
    assert_close(np.stack([lower + upper]), np.zeros((1, 3)), atol=1e-12)
    assert_close((upper - lower).max(), np.array(2.0), atol=1e-12)
    transform = transforms.Similarity.from_dict(answer["transform"])
    assert_close(transform.apply(np.array([[1e4, 0, -1e4]])), np.zeros((1, 3)), atol=0.2)
    assert 0 < answer["mean_distance_seen"] < answer["hausdorff_seen"] < 0.05
    assert answer["hausdorff"] == pytest.approx(answer["hausdorff_hidden"], rel=0.1)  # the ball inside is gone
    assert "hidden parts" in answer["outcome"]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["mesh", "{none}", "{out}.ply"], "no such file"),
        (["mesh", "{folder}", "{out}.ply"], "not a file"),
        (["mesh", "{soup}", "{out}.doc"], "must end in"),
        (["mesh", "{soup}", "{out}.ply", "--faces", "1"], "meshes.faces must be >= 4"),
        (["mesh", "{soup}", "{out}.ply", "--alpha", "2"], "meshes.alpha"),
        (["cast", "{soup}", "--rays", "{none}", "--out", "{out}.npz"], "none"),
        (["cast", "{soup}", "--rays", "{soup}", "--out", "{out}.npz"], "not a readable NPZ"),
        (["samples", "{soup}", "{out}.safetensors", "--count", "0"], "--count"),
        (["samples", "{soup}", "{out}.safetensors", "--epsilon", "-1"], "epsilon_o"),
    ],
)
def test_bad_input_is_one_line_and_code_two(arguments, reason, soup, tmp_path, capfd):
    names = {"soup": soup, "none": tmp_path / "none", "folder": tmp_path, "out": tmp_path / "out"}
    assert cli.main([argument.format(**names) for argument in arguments]) == 2
    captured = capfd.readouterr()
    assert captured.err.count("\n") == 1 and reason in captured.err and captured.out == ""
    assert not list(tmp_path.glob("out*"))


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
    ("arrays", "reason"),
    [
        ({"positions": np.zeros((2, 3))}, "no array 'directions'"),
        ({"positions": np.zeros((2, 3)), "directions": np.zeros((2, 2))}, "shape"),
        ({"positions": np.zeros((2, 3)), "directions": np.full((2, 3), 2.0)}, "unit length"),
        ({"positions": np.full((1, 3), np.nan), "directions": np.array([[0, 0, 1.0]])}, "finite"),
        ({"positions": np.zeros((1, 3)), "directions": np.zeros((3, 3))}, "1 positions but 3 directions"),
        ({"positions": np.array(["a"]), "directions": np.zeros((1, 3))}, "numbers"),
    ],
)
def test_cast_refuses_bad_rays(arrays, reason, soup, tmp_path, capfd):
    np.savez(tmp_path / "rays.npz", **arrays)
    assert cli.main(["cast", str(soup), "--rays", str(tmp_path / "rays.npz"), "--out", str(tmp_path / "h.npz")]) == 2
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and reason in error and "rays.npz" in error


def test_cast_takes_no_rays(soup, tmp_path):
    np.savez(tmp_path / "rays.npz", positions=np.zeros((0, 3)), directions=np.zeros((0, 3)))
    assert cli.main(["cast", str(soup), "--rays", str(tmp_path / "rays.npz"), "--out", str(tmp_path / "h.npz")]) == 0
    with np.load(tmp_path / "h.npz") as hits:
        assert hits["depth"].shape == (0,)


def test_samples_are_the_same_bytes_for_the_same_seed(soup, tmp_path, capfd):
    outs = [tmp_path / f"{i}.safetensors" for i in range(3)]
    for out, seed in zip(outs, ("1", "1", "2"), strict=True):
        assert cli.main(["samples", str(soup), str(out), "--seed", seed, "--count", "400", "--json"]) == 0
    answer = json.loads(capfd.readouterr().out.splitlines()[0])
    assert answer["counts"] == {"U": 400, "A": 400, "B": 200, "S": 200, "T": 200, "O": 200}
    assert outs[0].read_bytes() == outs[1].read_bytes() != outs[2].read_bytes()
    arrays, metadata = storage.load_tensors(outs[0])
    assert arrays["U.positions"].shape == (400, 3) and arrays["O.normals"].shape == (200, 2)
    assert metadata["seed"] == 1 and set(metadata["field_from_raw"]) == {"scale", "rotation", "translation"}

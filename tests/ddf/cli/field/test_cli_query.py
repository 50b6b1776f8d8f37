"""What is asked of a field: rays, points, a surface and distances, in the frame of its mesh."""

import re

import numpy as np
import pytest

import ddf
from ddf import cli
from ddf.data.synthetic import showcase
from ddf.fields import field_outputs
from ddf.geometry import mesh_io, raycast

CENTRE = np.array([100.0, 0.0, -50.0])  # of the torus


def test_query_answers_in_the_frame_of_the_mesh(fitted, tmp_path, answer):
    starts = CENTRE + np.array([[0.0, 60.0, 0.0], [0.0, 60.0, 0.0], [21.0, 0.0, 0.0], [6e4, 0.0, 0.0]])
    along = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    np.savez(tmp_path / "rays.npz", positions=starts, directions=along)
    names = tuple(field_outputs.OUTPUTS)
    words = ("query", fitted[0], "--rays", tmp_path / "rays.npz", "--out", tmp_path / "out.npz")
    result = answer(*words, "--outputs", ",".join(names))
    assert (result["rays"], result["evaluated"], result["saved"]) == (4, 3, 1)
    with np.load(tmp_path / "out.npz") as file:
        found = {name: file[name] for name in file.files}
    assert set(found) == set(names) and found["depth"].shape == (4,) and found["normals"].shape == (4, 3)
    assert np.isinf(found["depth"][1]) and found["visibility"][1] == 0
    assert np.array_equal(np.isfinite(found["depth"]), found["visibility"] >= 0.5)
    assert not any(np.isnan(values).any() for values in found.values())


def _table(path):
    """The names and columns of a PLY."""
    header, _, body = path.read_bytes().partition(b"end_header\n")
    found = re.findall(r"property (float|double) (\w+)", header.decode())
    rows = np.frombuffer(body, [(name, {"float": "<f4", "double": "<f8"}[kind]) for kind, name in found])
    names = [name for _, name in found]
    return names, np.stack([rows[name] for name in names], axis=1)


def test_points_are_in_the_frame_of_the_mesh(fitted, tmp_path, answer):
    assert answer("points", fitted[0], tmp_path / "cloud.ply", "-n", 50)["points"] == 50
    points = mesh_io.read_points(tmp_path / "cloud.ply")
    assert points.shape == (50, 3) and np.abs(points - CENTRE).max() < 300


def test_points_of_a_shipped_field_have_its_normals_and_say_so(tmp_path, answer):
    """The rabbit: a smooth closed surface. A step along the normal leaves it, one against it goes inside."""
    out = tmp_path / "cloud.ply"
    result = answer("points", "rabbit", out, "-n", 200)
    assert result["normals"].startswith("field ") and result["normals"].endswith("rabbit")
    names, table = _table(out)
    assert names == ["x", "y", "z", "nx", "ny", "nz"] and len(table) == 200
    lengths = np.linalg.norm(table[:, 3:], axis=1)
    assert np.abs(lengths[lengths > 0] - 1).max() < 1e-5 and (lengths == 0).sum() == result["without_normal"] < 10
    truth, known = raycast.Scene(showcase.rabbit()), table[lengths > 0]
    for way, share in ((0.05, 1.0), (-0.05, 0.0)):
        assert np.mean(truth.outside(known[:, :3] + way * known[:, 3:])) == pytest.approx(share, abs=0.05)
    assert np.array_equal(mesh_io.read_points(out), table[:, :3])


def test_surface_is_a_mesh_with_its_scores(tmp_path, answer):
    (tmp_path / "truth.ply").write_bytes(mesh_io.ply_bytes(showcase.rabbit()))
    words = ("surface", "rabbit", tmp_path / "m.ply", "--method", "udf", "--resolution", 48)
    result, mesh = answer(*words, "--truth", tmp_path / "truth.ply"), mesh_io.load(tmp_path / "m.ply")
    assert result["faces"] == len(mesh.faces) > 2000 and result["vertices"] == len(mesh.vertices)
    assert result["chamfer_l1"] < 0.03 and result["normal_consistency"] > 0.85
    other = showcase.rabbit().vertices * 1.02  # the truth itself has no floor of sampling
    (tmp_path / "other.ply").write_bytes(mesh_io.ply_bytes(mesh_io.Mesh(other, showcase.rabbit().faces)))
    farther = answer(*words, "--truth", tmp_path / "other.ply")["chamfer_l1"]
    assert result["chamfer_l1"] < 0.004 and 2 * result["chamfer_l1"] < farther < 0.02
    assert np.abs(mesh.vertices).max() < 1.6


@pytest.mark.usefixtures("few_hits")
@pytest.mark.parametrize(("size", "told"), [(1e3, True), (1.0, False), (1e-3, True)])
def test_other_units_are_asked_about_where_nothing_is_met(size, told, tmp_path, shown):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    starts = np.array([[-size, 5 * max(1, size), 0], [size, 5 * max(1, size), 0]])
    np.savez(tmp_path / "r.npz", positions=starts, directions=np.tile([0.0, 1, 0], (2, 1)))
    for words in (("query", "rabbit", "--rays"), ("udf", "rabbit", "--points"), ("cast", tmp_path / "a.obj", "--rays")):
        verdict = shown(*words, tmp_path / "r.npz", "--out", tmp_path / "out.npz")[-1]
        assert (" times the " in verdict and verdict.endswith("are its units others?")) == told


def test_a_truth_of_other_units_is_told_before_the_work(tmp_path, capfd, monkeypatch):
    truth = showcase.rabbit()
    (tmp_path / "t.ply").write_bytes(mesh_io.ply_bytes(mesh_io.Mesh(1000 * truth.vertices, truth.faces)))
    monkeypatch.setattr(ddf.Field, "surface", None)
    with pytest.raises(TypeError):
        cli.main(["surface", "rabbit", str(tmp_path / "m.ply"), "--truth", str(tmp_path / "t.ply")])
    assert "the true mesh's box is 9" in (said := capfd.readouterr().err) and "units others?" in said, said


@pytest.mark.usefixtures("few_hits")
def test_distances_are_those_of_the_interface(tmp_path, answer):
    positions = np.array([[0.0, 3.0, 0.0], [0.0, 0.0, 2.0]])
    np.savez(tmp_path / "p.npz", positions=positions)
    result = answer("udf", "rabbit", "--points", tmp_path / "p.npz", "--out", tmp_path / "u.npz")
    distances, directions = ddf.load("rabbit").udf(positions)
    with np.load(tmp_path / "u.npz") as found:
        np.testing.assert_allclose(found["distances"], distances, atol=1e-5)
        np.testing.assert_allclose(found["directions"], directions, atol=1e-5)
    assert result["points"] == 2 and result["least"] == pytest.approx(distances.min())

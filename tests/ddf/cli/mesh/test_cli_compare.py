"""`ddf compare` end to end: keys, values and refusals."""

import json

import numpy as np
import pytest

from ddf import cli
from ddf.geometry import mesh_io
from ddf.metrics import cloud_scores

_KEYS = {
    "chamfer_l2_sq",
    "f_score_tau",
    "f_score_2tau",
    "precision_tau",
    "recall_tau",
    "num_pred",
    "num_truth",
    "spacing_variation",
}


@pytest.fixture
def clouds(tmp_path):
    generator = np.random.default_rng(0)
    points = {"pred": generator.normal(size=(80, 3)) * 0.05, "truth": generator.normal(size=(120, 3)) * 0.05}
    for name, values in points.items():
        (tmp_path / f"{name}.ply").write_bytes(mesh_io.points_ply(values))
    return {name: str(tmp_path / f"{name}.ply") for name in points}


def test_json_holds_the_scores_of_the_library(clouds, capfd):
    assert cli.main(["compare", clouds["pred"], clouds["truth"], "--tau-sq", "4e-4", "--json"]) == 0
    got = json.loads(capfd.readouterr().out)
    assert got.keys() >= _KEYS
    pred, truth = (mesh_io.read_points(clouds[name]) for name in ("pred", "truth"))
    expected = cloud_scores.compare_clouds(pred, truth, 4e-4).to_dict()
    assert {key: got[key] for key in expected} == expected and 0 < got["f_score_tau"] < 1


def test_default_threshold_is_tau_and_text_names_every_score(clouds, capfd):
    assert cli.main(["compare", clouds["pred"], clouds["truth"]]) == 0
    *rows, verdict = capfd.readouterr().out.splitlines()
    lines = {name: rest for name, *rest in (line.split() for line in rows)}
    assert lines.keys() >= _KEYS and float(lines["tau_sq"][0]) == 1e-4 and lines["f_score_tau"][1] == "share"
    assert verdict.endswith("within 0.01 units: 80 points of pred.ply against 120 points of truth.ply")


def test_relative_scores_do_not_depend_on_the_unit_and_a_large_box_is_warned_of(clouds, tmp_path, capfd):
    large = {}
    for name, path in clouds.items():
        large[name] = str(tmp_path / f"{name}_mm.ply")
        (tmp_path / f"{name}_mm.ply").write_bytes(mesh_io.points_ply(1000 * mesh_io.read_points(path)))
    found = []
    for pair in (clouds, large):
        assert cli.main(["compare", pair["pred"], pair["truth"], "--relative", "--json"]) == 0
        found.append(json.loads(capfd.readouterr().out))
    for key in ("chamfer_l2_sq", "f_score_tau", "f_score_2tau"):
        assert found[0][key] == pytest.approx(found[1][key], rel=1e-4)
    assert found[1]["box_diagonal"] == pytest.approx(1000 * found[0]["box_diagonal"], rel=1e-6)
    pred, truth = (mesh_io.read_points(clouds[name]) / found[0]["box_diagonal"] for name in ("pred", "truth"))
    assert found[0]["chamfer_l2_sq"] == pytest.approx(cloud_scores.compare_clouds(pred, truth).chamfer_l2_sq)
    assert cli.main(["compare", large["pred"], large["truth"]]) == 0
    assert "units: --relative takes shares of that" in capfd.readouterr().out
    point = tmp_path / "point.ply"
    point.write_bytes(mesh_io.points_ply(np.ones((3, 3))))
    assert cli.main(["compare", clouds["pred"], str(point), "--relative"]) == 2
    assert "all points are one" in capfd.readouterr().err


def test_of_a_mesh_points_count_that_are_drawn_by_area(tmp_path, capfd):
    """A small and a large square: vertices alone would weigh them alike."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = mesh_io.Mesh(np.concatenate([corners, corners * 3 + 10]), np.concatenate([faces, faces + 4]))
    for suffix in (".ply", ".obj"):
        (tmp_path / f"mesh{suffix}").write_bytes(mesh_io.export_bytes(mesh, suffix))
    (tmp_path / "large.ply").write_bytes(mesh_io.points_ply(np.array([[10.0, 10, 10]])))

    def compare(*arguments):
        assert cli.main(["compare", *map(str, arguments), "--json"]) == 0
        return json.loads(capfd.readouterr().out)

    drawn = [
        compare(tmp_path / f"mesh{suffix}", tmp_path / "large.ply", "--tau-sq", "50") for suffix in (".ply", ".obj")
    ]
    assert drawn[0] == drawn[1]
    assert (drawn[0]["num_pred"], drawn[0]["pred"]) == (10_000, "10,000 points drawn by area (seed 0)")
    assert drawn[0]["precision_tau"] == pytest.approx(0.9, abs=0.02)  # 9 of 10 parts of the area lie near
    assert compare(tmp_path / "mesh.ply", tmp_path / "mesh.ply", "--points", "200")["chamfer_l2_sq"] > 0
    again = compare(tmp_path / "mesh.ply", tmp_path / "large.ply", "--tau-sq", "50", "--seed", "1")
    assert again["chamfer_l2_sq"] != drawn[0]["chamfer_l2_sq"]
    for suffix in (".ply", ".obj"):
        vertices = compare(tmp_path / f"mesh{suffix}", tmp_path / "large.ply", "--tau-sq", "50", "--vertices")
        assert (vertices["num_pred"], vertices["pred"], vertices["precision_tau"]) == (8, "8 vertices", 0.5)


def test_bad_input_is_one_line_and_code_two(clouds, tmp_path, capfd):
    (tmp_path / "empty.ply").write_bytes(mesh_io.points_ply(np.zeros((0, 3))))
    for arguments in (
        [clouds["pred"], str(tmp_path / "empty.ply")],
        [clouds["pred"], str(tmp_path / "absent.ply")],
        [clouds["pred"], clouds["truth"], "--tau-sq", "0"],
    ):
        assert cli.main(["compare", *arguments, "--json"]) == 2
        captured = capfd.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1 and captured.err.startswith("ddf compare: error: ")

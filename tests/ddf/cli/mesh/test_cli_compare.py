"""`ddf compare` end to end: keys and values."""

import numpy as np
import pytest

from ddf.geometry import mesh_io
from ddf.metrics import cloud_scores

_KEYS = set(
    "chamfer_l2_sq f_score_tau f_score_2tau precision_tau recall_tau num_pred num_truth spacing_variation".split()
)


@pytest.fixture
def clouds(tmp_path):
    generator = np.random.default_rng(0)
    points = {"pred": generator.normal(size=(80, 3)) * 0.05, "truth": generator.normal(size=(120, 3)) * 0.05}
    for name, values in points.items():
        (tmp_path / f"{name}.ply").write_bytes(mesh_io.points_ply(values))
    return {name: str(tmp_path / f"{name}.ply") for name in points}


def test_json_holds_the_scores_of_the_library(clouds, answer):
    got = answer("compare", clouds["pred"], clouds["truth"], "--tau-sq", "4e-4")
    assert got.keys() >= _KEYS
    pred, truth = (mesh_io.read_points(clouds[name]) for name in ("pred", "truth"))
    expected = cloud_scores.compare_clouds(pred, truth, 4e-4).to_dict()
    assert {key: got[key] for key in expected} == expected and 0 < got["f_score_tau"] < 1


def test_relative_scores_do_not_depend_on_the_unit(clouds, tmp_path, answer):
    large = {}
    for name, path in clouds.items():
        large[name] = str(tmp_path / f"{name}_mm.ply")
        (tmp_path / f"{name}_mm.ply").write_bytes(mesh_io.points_ply(1000 * mesh_io.read_points(path)))
    found = [answer("compare", pair["pred"], pair["truth"], "--relative") for pair in (clouds, large)]
    for key in ("chamfer_l2_sq", "f_score_tau", "f_score_2tau"):
        assert found[0][key] == pytest.approx(found[1][key], rel=1e-4)
    assert found[1]["box_diagonal"] == pytest.approx(1000 * found[0]["box_diagonal"], rel=1e-6)
    pred, truth = (mesh_io.read_points(clouds[name]) / found[0]["box_diagonal"] for name in ("pred", "truth"))
    assert found[0]["chamfer_l2_sq"] == pytest.approx(cloud_scores.compare_clouds(pred, truth).chamfer_l2_sq)


def test_of_a_mesh_points_count_that_are_drawn_by_area(tmp_path, answer):
    """A small and a large square: vertices alone would weigh them alike."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = mesh_io.Mesh(np.concatenate([corners, corners * 3 + 10]), np.concatenate([faces, faces + 4]))
    for suffix in (".ply", ".obj"):
        (tmp_path / f"mesh{suffix}").write_bytes(mesh_io.export_bytes(mesh, suffix))
    (tmp_path / "large.ply").write_bytes(mesh_io.points_ply(np.array([[10.0, 10, 10]])))

    def compare(name, *arguments):
        return answer("compare", tmp_path / name, tmp_path / "large.ply", "--tau-sq", "50", *arguments)

    drawn = [compare(f"mesh{suffix}") for suffix in (".ply", ".obj")]
    assert drawn[0] == drawn[1]
    assert (drawn[0]["num_pred"], drawn[0]["pred"]) == (10_000, "10,000 points drawn by area (seed 0)")
    assert drawn[0]["precision_tau"] == pytest.approx(0.9, abs=0.02)  # 9 of 10 parts of the area lie near
    assert answer("compare", tmp_path / "mesh.ply", tmp_path / "mesh.ply", "--points", "200")["chamfer_l2_sq"] > 0
    assert compare("mesh.ply", "--seed", "1")["chamfer_l2_sq"] != drawn[0]["chamfer_l2_sq"]

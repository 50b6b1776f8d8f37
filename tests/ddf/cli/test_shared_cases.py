"""The kept small cases that fail elsewhere, through the commands that meet them."""

import numpy as np
import pytest
import yaml
from _tiny_fits import SECTION

from ddf.core import storage
from ddf.fields import shape_field

pytestmark = pytest.mark.real


@pytest.fixture
def cases(shared_dir):
    return shared_dir / "cases"


def test_concave_prism_is_cast_right(cases, tmp_path, answer):
    out = tmp_path / "hits.npz"
    found = answer("cast", cases / "L2.obj", "--rays", cases / "L2.rays.npz", "--out", out)
    assert (found["rays"], found["hits"]) == (3, 2)
    with np.load(out) as hits:
        np.testing.assert_allclose(hits["depth"], [np.inf, 4, 4], rtol=1e-12)


def test_rows_longer_than_declared_are_refused_and_declared_ones_give_the_right_scores(
    cases, tmp_path, answer, refusal
):
    undeclared, cloud = cases / "cloud_undeclared.ply", cases / "cloud_b.ply"
    error = refusal("compare", undeclared, cloud, "--tau-sq", ".01")
    assert "cloud_undeclared.ply: line 8: 6 words in a row of vertex; 3 are declared" in error
    same = answer("compare", cloud, cloud, "--tau-sq", ".01")
    assert (same["chamfer_l2_sq"], same["f_score_tau"], same["num_pred"]) == (0, 1, 60)
    more = "".join(f"property float {name}\n" for name in "zabc")
    (tmp_path / "declared.ply").write_text(undeclared.read_text().replace("property float z\n", more))
    found = answer("compare", tmp_path / "declared.ply", cloud, "--tau-sq", ".01")
    assert found["chamfer_l2_sq"] == pytest.approx(0.061934, abs=1e-6)
    assert found["f_score_tau"] == pytest.approx(0.227737, abs=1e-6)


def test_a_far_triangle_without_area_moves_neither_samples_nor_fit(cases, tmp_path, answer, shown):
    mesh, out = cases / "far_point_face.obj", tmp_path / "samples.safetensors"
    found = answer("samples", mesh, out, "--count", 200)
    _, record = storage.load_tensors(out)
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump({"fit": {**SECTION, "margin": 0.0}}))
    shown("fit", mesh, tmp_path / "fit", "--config", tmp_path / "tiny.yaml")
    own = shape_field.load(tmp_path / "fit").record
    for frame in (found["field_from_raw"], record["field_from_raw"], own["field_from_mesh"]):
        assert (frame["scale"], frame["translation"]) == (2, [-1, -1, -1])


def test_a_picture_turned_by_exif_is_reconstructed_alike(cases, tmp_path, answer):
    made = [
        (
            answer("reconstruct", cases / f"{name}.png", "chair", tmp_path / name, "-n", 50)["camera"],
            (tmp_path / name / "cloud.ply").read_bytes(),
        )
        for name in ("base", "exif6")
    ]
    assert made[0] == made[1]


def test_a_synset_given_twice_is_refused(cases, tmp_path, refusal):
    line = refusal("split", cases / "ids_repeated_key.json", "--out", tmp_path / "lists")
    assert "'03001627' is given twice" in line

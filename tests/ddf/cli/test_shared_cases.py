"""The kept small cases that fail elsewhere, through the commands that meet them."""

import json

import numpy as np
import pytest
import yaml
from _tiny_fits import SECTION

from ddf import cli
from ddf.core import storage
from ddf.fields import shape_field

pytestmark = pytest.mark.real


@pytest.fixture
def cases(shared_dir):
    return shared_dir / "cases"


def _json(capfd, *arguments):
    assert cli.main([*map(str, arguments), "--json"]) == 0
    return json.loads(capfd.readouterr().out)


def test_concave_prism_is_cast_right(cases, tmp_path, capfd):
    out = tmp_path / "hits.npz"
    found = _json(capfd, "cast", cases / "L2.obj", "--rays", cases / "L2.rays.npz", "--out", out)
    assert (found["rays"], found["hits"]) == (3, 2)
    with np.load(out) as hits:
        np.testing.assert_allclose(hits["depth"], [np.inf, 4, 4], rtol=1e-12)


def test_rows_longer_than_declared_are_refused_and_the_other_cloud_is_scored(cases, capfd):
    undeclared, cloud = cases / "cloud_undeclared.ply", cases / "cloud_b.ply"
    assert cli.main(["compare", str(undeclared), str(cloud), "--tau-sq", ".01"]) == 2
    assert "cloud_undeclared.ply: line 8: 6 words in a row of vertex; 3 are declared" in capfd.readouterr().err
    same = _json(capfd, "compare", cloud, cloud, "--tau-sq", ".01")
    assert (same["chamfer_l2_sq"], same["f_score_tau"], same["num_pred"]) == (0, 1, 60)


def test_declared_rows_give_the_right_distance(cases, tmp_path, capfd):
    text = (cases / "cloud_undeclared.ply").read_text()
    declared = text.replace(
        "property float z\n", "property float z\nproperty float a\nproperty float b\nproperty float c\n"
    )
    (tmp_path / "declared.ply").write_text(declared)
    found = _json(capfd, "compare", tmp_path / "declared.ply", cases / "cloud_b.ply", "--tau-sq", ".01")
    assert found["chamfer_l2_sq"] == pytest.approx(0.061934, abs=1e-6)
    assert found["f_score_tau"] == pytest.approx(0.227737, abs=1e-6)


def test_a_far_triangle_without_area_moves_neither_samples_nor_fit(cases, tmp_path, capfd):
    mesh, out = cases / "far_point_face.obj", tmp_path / "samples.safetensors"
    found = _json(capfd, "samples", mesh, out, "--count", "200")
    _, record = storage.load_tensors(out)
    (tmp_path / "tiny.yaml").write_text(yaml.safe_dump({"fit": {**SECTION, "margin": 0.0}}))
    assert cli.main(["fit", str(mesh), str(tmp_path / "fit"), "--config", str(tmp_path / "tiny.yaml")]) == 0
    own = shape_field.load(tmp_path / "fit").record
    for frame in (found["field_from_raw"], record["field_from_raw"], own["field_from_mesh"]):
        assert (frame["scale"], frame["translation"]) == (2, [-1, -1, -1])


def test_a_picture_turned_by_exif_is_reconstructed_alike(cases, tmp_path, capfd):
    made = []
    for name in ("base", "exif6"):
        arguments = ("reconstruct", cases / f"{name}.png", "chair", tmp_path / name, "-n", "50")
        made.append(_json(capfd, *arguments)["camera"])
    assert made[0] == made[1]
    assert (tmp_path / "base" / "cloud.ply").read_bytes() == (tmp_path / "exif6" / "cloud.ply").read_bytes()


def test_a_synset_given_twice_is_refused(cases, tmp_path, capfd):
    assert cli.main(["split", str(cases / "ids_repeated_key.json"), "--out", str(tmp_path / "lists")]) == 2
    assert "'03001627' is given twice" in capfd.readouterr().err

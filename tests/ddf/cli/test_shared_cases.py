"""The kept small cases that fail elsewhere, through the commands that meet them."""

import numpy as np
import pytest

from ddf.data import cutouts
from ddf.geometry import mesh_io

pytestmark = pytest.mark.real


@pytest.fixture
def cases(shared_dir):
    return shared_dir / "cases"


@pytest.mark.usefixtures("quick_completion")
def test_a_far_scan_is_completed_to_all_its_digits(cases, tmp_path, answer):
    answer("complete", cases / "round4" / "l_utm.npz", "chair", tmp_path / "out", "-n", 60)
    found = [mesh_io.read_points(tmp_path / "out" / f"{name}.ply") for name in ("seen", "inferred")]
    with np.load(tmp_path / "out" / "cloud.npz") as file:
        points, seen = file["points"], file["seen"]
    np.testing.assert_array_equal(np.concatenate(found), np.concatenate((points[seen], points[~seen])))
    assert len(np.unique(points[:, 1])) == 60 and np.ptp(points[:, 1]) < 2


def test_a_mask_of_0_and_1_and_a_field_of_any_file_name_are_read(cases, tmp_path, answer, refusal):
    round4 = cases / "round4"
    assert 0.05 < (cutouts.read(round4 / "i_w2.png", mask=round4 / "mk01.png")[..., 3] > 0).mean() < 0.95
    words = ("--rays", round4 / "r.npz", "--out", tmp_path / "a.npz")
    assert answer("query", round4 / "renamed.safetensors", *words)["rays"] == 2
    assert "model.pt: is no field: give a folder" in refusal("query", round4 / "model.pt", *words)

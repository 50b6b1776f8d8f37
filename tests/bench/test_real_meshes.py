"""Rows of real meshes: frames, what is skipped, and that silhouettes are compared as they should be."""

import numpy as np
import pytest
import torch
from _support import assert_close
from PIL import Image

from bench.lib import measuring
from bench.reconstruction import real_meshes
from ddf.core import checks, shipped_models
from ddf.geometry import cameras, mesh_io
from ddf.models.reconstruction import one_image

CUBE = mesh_io.Mesh(np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 5]]), np.array([[0, 1, 2], [0, 2, 3]]))


@pytest.mark.parametrize("real", real_meshes.MESHES, ids=lambda real: real.file)
def test_axes_turn_a_mesh_without_mirroring_it(real):
    corner = mesh_io.Mesh(np.concatenate([np.zeros((1, 3)), np.eye(3)]), np.array([[1, 2, 3]]))
    found = real.vertices(corner) * np.sqrt(3)  # undoes the diagonal
    turn = (found[1:] - found[0]).T
    assert_close(turn @ turn.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(turn) > 0


def test_vertices_are_in_the_v1_frame_with_the_stated_axes():
    found = real_meshes.RealMesh("", "car", ("z", "y", "-x")).vertices(CUBE)
    assert_close(np.ptp(found, axis=0), np.array([5.0, 3.0, 2.0]) / np.sqrt(38), atol=1e-7)
    assert_close(found.min(axis=0), -found.max(axis=0), atol=2e-8)
    assert found[3, 0] > 0 > found[1, 2]  # what was far along Z is ahead, what was far along X lies at -Z


def test_without_meshes_one_line_says_so_and_nothing_is_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(measuring, "OUT", tmp_path / "out")
    real_meshes.main(["--meshes", str(tmp_path)])
    told = capsys.readouterr().out
    assert told.startswith(f"real_meshes: skipped, {tmp_path} holds none of car_kaykit_sedan.obj, ")
    assert told.count("\n") == 1 and not (tmp_path / "out").exists()


def test_more_clouds_than_views_are_refused():
    with pytest.raises(checks.InputError, match=r"--clouds must be in 1\.\.--views; got 5 of 4"):
        real_meshes.main(["--clouds", "5", "--views", "4"])


def test_models_are_those_of_the_package_or_of_a_folder(tmp_path):
    assert real_meshes.model_of("car", None) == shipped_models.place("car")
    assert real_meshes.model_of("car", tmp_path) == tmp_path / "car"


@pytest.mark.real
def test_a_car_is_rendered_inside_its_mask_and_measured(tmp_path):
    real, folder = real_meshes.MESHES[0], measuring.REAL_MESHES
    if not (folder / real.file).is_file():
        pytest.skip("the real meshes are absent")
    made = real_meshes.renders(real, folder, tmp_path, 3)
    assert made.cameras.shape == (3, 3) and 7_000 < len(made.truth) < 9_000
    u, v = cameras.project(torch.from_numpy(made.truth), *cameras.extrinsics(*torch.from_numpy(made.cameras[2])))
    pixels = np.array(Image.open(made.images[2]))
    assert (pixels[v.floor().long().numpy(), u.floor().long().numpy(), 3] > 0).all()

    model, size = one_image.load(shipped_models.place("car"))
    found = one_image.reconstruct(model, size, made.images[0], 200)
    own, _ = real_meshes.rendering.render(
        model.field, found.modulations, found.camera, torch.tensor(1 / found.scale), size, ("visibility",)
    )
    assert real_meshes.silhouette_iou(model, found, own["visibility"]) == 1
    assert real_meshes.silhouette_iou(model, found, torch.zeros(size, size)) == 0
    row = real_meshes.measure(real, shipped_models.place("car"), folder, 2, 1)
    assert row["what"] == "real meshes, our renderer: car_kaykit_sedan"
    assert 0.02 < row["error"]["chamfer_l2_sq_x1000"] < 5 and row["error"]["azimuth_turned_x100"] in (0, 50, 100)

"""`ddf complete`."""

import dataclasses
import json

import numpy as np
import pytest
from PIL import Image

import ddf
from ddf import cli
from ddf.core import shipped_models
from ddf.geometry import mesh_io, scans

DOUBTS = ((0.6, 0.4), (0.4, 0.9), (0.9, 0.2))  # explained and likeness

pytestmark = pytest.mark.usefixtures("quick_completion")


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    image = shipped_models.ROOT / "chair" / "sample_0.png"
    sweep = ddf.depth_camera(ddf.reconstruct(image, "chair", n=100).field, size=48)
    sweep.save(tmp_path_factory.mktemp("scan") / "scan.npz")
    return tmp_path_factory.getbasetemp() / "scan0" / "scan.npz"


def test_complete_writes_a_field_that_loads_and_clouds(scan, tmp_path, answer):
    pose = np.diag([0.32, 0.32, 0.32, 1.0])
    (tmp_path / "pose.json").write_text(json.dumps(pose.tolist()))
    words = ("--pose", tmp_path / "pose.json", "--fixed", "-n", 200)
    result = answer("complete", scan, "chair", tmp_path / "out", *words)
    np.testing.assert_allclose(result["pose"], pose)
    assert result["likeness"] > 0.5
    seen, inferred = (mesh_io.read_points(tmp_path / "out" / f"{name}.ply") for name in ("seen", "inferred"))
    assert len(seen) + len(inferred) == 200 and result["seen"] == pytest.approx(len(seen) / 200)
    with np.load(tmp_path / "out" / "cloud.npz") as file:
        arrays = {name: file[name] for name in file.files}
    np.testing.assert_allclose(arrays["points"][arrays["seen"].astype(bool)], seen, atol=1e-6)
    assert arrays["residuals"].shape == (48**2,) and arrays["spread"].shape == (200,)
    given = scans.read(scan)
    depth = ddf.load(tmp_path / "out").query(given.positions, given.directions)["depth"]
    both = np.isfinite(depth) & given.hit
    assert (both & np.isnan(arrays["residuals"])).sum() <= 2  # rounding decides whether a ray at the rim is seen
    both &= np.isfinite(arrays["residuals"])
    assert both.sum() > 20
    residuals = arrays["residuals"][both]
    np.testing.assert_allclose(given.ranges[both] - depth[both], residuals, atol=2e-3)
    assert result["residual_median"] == pytest.approx(np.median(np.abs(residuals)), abs=2e-3)


def test_few_hits_the_place_in_words_and_a_picture(tmp_path, capfd):
    ddf.depth_camera(ddf.load("armchair"), size=12).save(tmp_path / "few.npz")
    pose = np.array([[0.8, 0, 0.6, 0.1], [0, 1, 0, 0], [-0.6, 0, 0.8, 0], [0, 0, 0, 1]])
    (tmp_path / "pose.json").write_text(json.dumps(pose.tolist()))
    words = ("complete", tmp_path / "few.npz", "chair", tmp_path / "out", "--pose", tmp_path / "pose.json", "--fixed")
    assert cli.main([*map(str, words), "-n", "50"]) == 0
    said = capfd.readouterr()
    assert "hits of 144 rays; seeks shape, some" in said.err and "too few to tell how much" in said.out
    assert "stands at 0.1, 0, 0; turned 37 degrees about up; longest side 2, units of the scan" in said.out
    colours = {tuple(each) for each in np.asarray(Image.open(tmp_path / "out" / "picture.png")).reshape(-1, 3).tolist()}
    assert len(colours) > 100


def test_a_depth_image_without_its_cameras_place_stands_upright(scan):
    eye, side = np.array([0.9, 1.4, 2.4]), 32
    ahead = -eye / np.linalg.norm(eye)
    right = np.cross(ahead, [0, 1, 0]) / np.linalg.norm(np.cross(ahead, [0, 1, 0]))
    turn = np.stack([right, np.cross(ahead, right), ahead])  # the camera's axes in the frame of the field: Y is down
    intrinsics = np.array([[34.0, 0, side / 2], [0, 34.0, side / 2], [0, 0, 1]])
    along = scans.pixel_directions(side, side, intrinsics)
    depth = ddf.load("armchair").query(np.broadcast_to(eye, along.shape), along @ turn)["depth"] * along[:, 2]
    seen = scans.of_depth(np.where(np.isfinite(depth), depth, np.inf).reshape(side, side), intrinsics)
    assert seen.of_camera and not scans.read(scan).of_camera
    chair = ddf.complete(seen, "chair", n=50)
    up = chair.pose[:3, 1] / np.linalg.norm(chair.pose[:3, 1])
    assert up @ turn[:, 1] > 0.8  # the camera's Y is down
    told = [dataclasses.replace(chair, explained=explained, likeness=likeness).unlike for explained, likeness in DOUBTS]
    assert told == [False, True, True]

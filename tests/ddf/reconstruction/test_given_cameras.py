"""Cameras from files: a box rendered by pinholes that turn, roll and bend, in every layout; and what is refused."""

import dataclasses
import json
from pathlib import Path

import _hand_made
import numpy as np
import pytest
import torch
from PIL import Image
from scipy import ndimage
from scipy.spatial.transform import Rotation

from ddf.cli import frame, models
from ddf.core import checks, storage
from ddf.data import cutouts
from ddf.fields import model_files
from ddf.geometry import cameras, transforms
from ddf.models import line_field
from ddf.reconstruction import given_cameras

HALF = np.array([0.4, 0.2, 0.25])  # of the box, v1
HALF /= 2 * np.linalg.norm(HALF)
AROUND = [(30.0, 25.0, 0.8), (150.0, 40.0, 0.9), (-80.0, 10.0, 0.7)]
SIZE, FOCAL, BENT, OFF = (420, 300), 330.0, 0.08, (12.0, -9.0)  # k_1; principal point from the middle, pixels
Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def _seen(start, ways):
    """Whether rays meet the box."""
    with np.errstate(divide="ignore"):
        one, other = (-HALF - start) / ways, (HALF - start) / ways
    return np.minimum(one, other).max(axis=-1) < np.maximum(one, other).min(axis=-1)


def _true(camera):
    """The silhouette that the models' lens sees."""
    ways = cameras.pixel_directions(given_cameras.SIDE, np.zeros(1)).reshape(-1, 3)
    start, ways = cameras.pixel_rays(camera[0], camera[1], camera[2], ways)
    return _seen(start / transforms.BENCHMARK_FROM_V1, ways).reshape(given_cameras.SIDE, given_cameras.SIDE)


def _pose(around, random):
    """Camera to v1: looks beside the object, and rolls."""
    azimuth, elevation, radius = np.radians(around[0]), np.radians(around[1]), around[2]
    matrix = np.eye(4)
    turned = Rotation.from_rotvec(np.append(random.uniform(-0.12, 0.12, 2), random.uniform(-3, 3))).as_matrix()
    matrix[:3, :3] = cameras.rotation(*np.array([azimuth, elevation])).T @ turned
    matrix[:3, 3] = cameras.position(*np.array([azimuth, elevation, radius])) / transforms.BENCHMARK_FROM_V1
    return matrix


def _picture(pose, off=OFF, bent=BENT):
    column, row = np.meshgrid(*(np.arange(side) + 0.5 for side in SIZE))
    distorted = np.stack([column - SIZE[0] / 2 - off[0], -(row - SIZE[1] / 2 - off[1])], axis=-1) / FOCAL
    plane = distorted
    for _ in range(20):
        plane = distorted / (1 + bent * (plane**2).sum(axis=-1, keepdims=True))
    ways = np.concatenate([plane, -np.ones((*plane.shape[:2], 1))], axis=-1) @ pose[:3, :3].T
    pixels = np.full((*ways.shape[:2], 4), 200, np.uint8)
    pixels[..., 3] = 255 * _seen(pose[:3, 3], ways)
    pixels[pixels[..., 3] == 0] = 0
    return pixels


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three pictures, with cameras in every layout."""
    out, random = tmp_path_factory.mktemp("given"), np.random.default_rng(0)
    poses = [_pose(around, random) for around in AROUND]
    for number, pose in enumerate(poses):
        Image.fromarray(_picture(pose)).save(out / f"r_{number}.png")
    middle = {"cx": SIZE[0] / 2 + OFF[0], "cy": SIZE[1] / 2 + OFF[1]}
    lens = {"fl_x": FOCAL, "w": SIZE[0], "h": SIZE[1], "k1": BENT, **middle}
    own = [{"camera_to_world": pose.tolist(), **lens} for pose in poses]
    moved = transforms.Similarity(3.0, Rotation.from_rotvec([0.3, -1.0, 0.2]).as_matrix(), np.array([5.0, -2.0, 1.0]))
    elsewhere = [moved.compose(transforms.Similarity.of_matrix("pose", pose)) for pose in poses]
    stored = [dataclasses.replace(pose, scale=1.0).to_matrix().tolist() for pose in elsewhere]
    placed = {"object_to_world": moved.to_matrix().tolist(), **lens}
    up = np.eye(4)
    up[:3, :3] = Z_UP
    frames = [{"file_path": f"./r_{n}", "transform_matrix": (up @ pose).tolist()} for n, pose in enumerate(poses)]
    frames += [{**frames[0], "file_path": "./test/r_0.png"}, {**frames[0], "file_path": "./r_7"}]
    layouts = {
        "list": own,
        "names": {f"r_{number}.png": own[number] for number in (2, 0, 1)},
        "moved": [{"camera_to_world": pose, **placed} for pose in stored],
        "transforms": {"camera_model": "OPENCV", **lens, "frames": frames},
    }
    for name, content in layouts.items():
        (out / f"{name}.json").write_text(json.dumps(content))
    return out


def _images(folder):
    return [folder / f"r_{number}.png" for number in range(3)]


@pytest.mark.parametrize("layout", ["list", "names", "moved", "transforms"])
def test_a_picture_is_turned_into_what_the_models_lens_sees(folder, layout):
    images = _images(folder)
    found = given_cameras.read(folder / f"{layout}.json", images)
    for camera, image, around in zip(found, images, AROUND, strict=True):
        assert isinstance(camera, given_cameras.Pinhole)
        turned, seen_from = camera.framed(cutouts.read(image), 0.95)
        wanted = cameras.degrees_to_radians(np.array(around))
        np.testing.assert_allclose(np.mod(seen_from, 2 * np.pi), np.mod(wanted, 2 * np.pi), atol=1e-6)
        own, truth = turned[..., 3] >= 128, _true(wanted)
        assert (own & truth).sum() > 0.99 * (own | truth).sum()
        assert (turned[own][:, :3] == 200).all()  # edges are not darkened by what is transparent


def test_far_away_the_object_is_magnified():
    around = (30.0, 25.0, 3.0)
    pose = _pose(around, np.random.default_rng(1))
    given = {"camera_to_world": pose, "camera_angle_x": 2 * np.arctan(SIZE[0] / 2 / FOCAL)}
    (camera,) = given_cameras.read([given], [Path("a.png")])
    assert isinstance(camera, given_cameras.Pinhole)
    turned, seen_from = camera.framed(_picture(pose, (0, 0), 0.0), 0.8)
    assert seen_from[2] == pytest.approx(1.0)
    own, truth = turned[..., 3] >= 128, _true(seen_from)
    assert (own & truth).sum() > 0.85 * (own | truth).sum()  # by perspective it differs


def test_the_field_of_three_pictures_is_their_hull(folder, tmp_path, monkeypatch, capsys):
    torch.manual_seed(0)
    train, config = dataclasses.replace(_hand_made.TRAIN, image_size=64), line_field.LineFieldConfig(32, 16)
    model = line_field.ImageDDFModel(train, config)
    model.fit_cameras(_hand_made.images())
    torch.nn.init.zeros_(model.decoder.head.weight)
    torch.nn.init.constant_(model.decoder.head.bias, 4.0)  # solid wherever all pictures are opaque
    record = {"kind": "ddf_image", "train": dataclasses.asdict(train), "section": dataclasses.asdict(config)}
    storage.save_tensors(tmp_path / "hull" / model_files.MODEL, dict(model.state_dict()), record)
    saved = []
    made = {"points": 0, "faces": 0, "verdict": "", "unlike_training": None}

    def save(found, _):
        saved.append(found)
        seen = [{"silhouette_iou": overlap} for overlap in found.overlaps]
        return made | {"camera": found.camera, "cameras": seen}

    monkeypatch.setattr("ddf.api.reconstruction.Reconstruction.save", save)
    words = ("reconstruct", *_images(folder), tmp_path / "hull", tmp_path, "--together", "--cameras")
    assert frame.main([str(word) for word in (*words, folder / "transforms.json")]) == 0
    assert len(saved[0].overlaps) == 3 and min(saved[0].overlaps) > 0.85 and "outline" not in capsys.readouterr().out
    views = saved[0]._found.views
    object.__setattr__(saved[0]._found, "views", [views[0], views[0].transpose(1, 0, 2), views[2]])
    del saved[0].overlaps
    few, name = save(saved[0], None) | {"image": "a", "out": "b"}, _images(folder)[1].name
    assert f"they overlap in {name} by 0." in models._line(few, _images(folder), ("", ""))
    points = saved[0].points
    for around in AROUND:
        camera = cameras.degrees_to_radians(np.array(around))
        near = ndimage.binary_dilation(_true(camera), iterations=18)  # two pixels of the encoder's image
        place = cameras.project(points * transforms.BENCHMARK_FROM_V1, *cameras.extrinsics(*camera))
        column, row = (np.clip(2 * each, 0, given_cameras.SIDE - 1).astype(int) for each in place)
        assert near[row, column].mean() > 0.99
    assert (np.abs(points).max(axis=0) > 0.95 * HALF).all()
    (tmp_path / "camera.json").write_text(json.dumps({"camera": saved[0].camera, "cameras": saved[0].cameras}))
    told = given_cameras.read(tmp_path / "camera.json", _images(folder))
    np.testing.assert_allclose(np.array(told), cameras.degrees_to_radians(np.array(AROUND)), atol=1e-6)


SHEARED, AWAY, WITHIN = np.eye(4), np.eye(4), np.eye(4)
SHEARED[0, 1] = 0.1
AWAY[2, 3], WITHIN[2, 3] = -2.0, 0.3
LENS = {"fl_x": 300.0, "w": 420}
WIDE = {"camera_angle_x": 1.2, "w": 420}


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ([[0, 0, 1]] * 2, "1 pictures, 2 cameras"),
        ({"b.png": [0, 0, 1]}, "needs one camera of a.png; there are b.png .did you mean b.png"),
        ({"frames": [{"file_path": "x/a"}, {"file_path": "y/a.png"}]}, "needs one camera of a.png"),
        ([[0, 0]], "is azimuth, elevation .degrees. and radius > 0"),
        ([[0, 0, -1]], "radius > 0"),
        ([[0, float("nan"), 1]], "radius > 0"),
        ([{"azimuth_deg": 1.0}], "radius > 0"),
        (3, "radius > 0"),
        ({"camera": 3}, "radius > 0"),
        ({"frames": [{"file_path": "a.png"}, {"file_path": "a.png"}]}, "two frames have the same file_path"),
        ([{"camera_to_world": np.eye(4).tolist(), "camera_angle_x": 0.7, "cx": 100.0}], "w of its lens"),
        ("{", "JSON"),
        ([{"camera_to_world": SHEARED.tolist(), **LENS}], "shears or mirrors"),
        ([{"camera_to_world": np.diag([2.0, 2, 2, 1]).tolist(), **LENS}], "must turn and move alone; it scales by 2"),
        ([{"camera_to_world": np.eye(4).tolist()}], "camera_angle_x of its lens is a number > 0; got None"),
        ([{"camera_to_world": np.eye(4).tolist(), "camera_angle_x": 40.0}], "in radians, below pi; got 40"),
        ([{"camera_to_world": np.abs(AWAY).tolist(), **WIDE, "h": 420}], "w and h are not of the picture's shape"),
        ([{"camera_to_world": np.eye(4).tolist(), "fl_x": 300.0}], "w of its lens"),
        ([{"camera_to_world": np.eye(4).tolist(), **LENS, "camera_model": "OPENCV_FISHEYE"}], "FISHEYE is not read"),
        ([{"camera_to_world": AWAY.tolist(), **LENS}], "does not look at the object"),
        ([{"camera_to_world": WITHIN.tolist(), **LENS}], "does not look at the object"),
        ([{"camera_to_world": (-AWAY).tolist(), **LENS}], "4x4"),
        ([{"camera_to_world": np.abs(AWAY).tolist(), **LENS, "h": 420}], "w and h are not of the picture's shape"),
        ([{"camera_to_world": np.abs(AWAY).tolist(), **LENS}], "shows nothing where the object stands"),
    ],
)
def test_what_does_not_do_is_told(content, told, tmp_path):
    file = tmp_path / "cameras.json"
    file.write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(checks.InputError, match=told):
        (camera,) = given_cameras.read(file, [tmp_path / "a.png"])
        assert isinstance(camera, given_cameras.Pinhole)
        camera.framed(np.zeros((300, 420, 4), np.uint8), 0.95)


def test_a_lens_of_more_terms_is_refused():
    lens = {"camera_model": "OPENCV", "fl_x": 500, "w": 640, "h": 480, "k3": 0.3}
    frame = {"file_path": "a.png", "transform_matrix": np.eye(4).tolist()}
    with pytest.raises(checks.InputError, match="undistort"):
        given_cameras._camera(frame, lens, "a.png")

"""Folders of posed depth images and clouds, each written here as its own makers lay it out."""

import json
from collections.abc import Sequence
from pathlib import Path

import laspy
import numpy as np
import pytest
from _sphere_scan import sphere_scan
from PIL import Image

from ddf.core import checks
from ddf.geometry import mesh_io, posed_depth, scans

CLOUDS = Path(__file__).parent / "clouds"  # of other makers, see its README.md
HEIGHT, WIDTH, FOCAL, FAR = 6, 8, 10.0, 1.5  # a wall at z = FAR, seen by cameras that look along Z from x = 0 and 0.25
POSES = np.tile(np.eye(4), (2, 1, 1))
POSES[1, 0, 3] = 0.25


def depths(file: Path, step: float) -> None:
    """A PNG of 16 bits, its first pixel without a depth."""
    image = np.full((HEIGHT, WIDTH), round(FAR / step), np.uint16)
    image[0, 0] = 0
    file.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(file)


def open3d_camera(folder: Path) -> None:
    """Intrinsics as Open3D writes them, by columns, pixels' centres at whole numbers."""
    matrix = [FOCAL, 0, 0, 0, FOCAL, 0, WIDTH / 2 - 0.5, HEIGHT / 2 - 0.5, 1]
    camera = {"width": WIDTH, "height": HEIGHT, "intrinsic_matrix": matrix}
    (folder / "camera.json").write_text(json.dumps(camera))


def _check_wall(found: posed_depth.Sensed) -> None:
    """Both images, symmetric about the optical axis, on the wall."""
    scan = found.scan
    assert found.frames == 2 and len(scan.ranges) == 2 * (HEIGHT * WIDTH - 1)
    assert np.allclose(scan.points[:, 2], FAR)
    assert np.array_equal(np.unique(scan.positions, axis=0), POSES[:, :3, 3])
    half = FAR * (WIDTH - 1) / 2 / FOCAL
    assert np.isclose(scan.points[:, 0].min(), -half) and np.isclose(scan.points[:, 0].max(), 0.25 + half)
    assert "frames 2, rays 94, hits 94 in a box of " in found.told


def test_tum(tmp_path: Path) -> None:
    lines = ["# depth maps", "# timestamp filename"]
    for time in (1.5, 2.5, 9.0):  # the last has no pose near it
        depths(tmp_path / f"depth/{time:.6f}.png", 1 / 5000)
        lines.append(f"{time:.6f} depth/{time:.6f}.png")
    (tmp_path / "depth.txt").write_text("\n".join(lines))
    poses = ["# timestamp tx ty tz qx qy qz qw", "1.4900 0 0 0 0 0 0 1", "2.5100 0.25 0 0 0 0 0 1"]
    (tmp_path / "groundtruth.txt").write_text("\n".join(poses))
    open3d_camera(tmp_path)
    _check_wall(posed_depth.read(tmp_path))


def test_quaternions_turn_as_tum_says(tmp_path: Path) -> None:
    depths(tmp_path / "depth/1.png", 1 / 5000)
    (tmp_path / "depth.txt").write_text("1.0 depth/1.png\n")
    (tmp_path / "groundtruth.txt").write_text("1.0 0 0 0 0 0.7071 0 0.7071\n")  # 90 degrees about Y: Z goes to X
    open3d_camera(tmp_path)
    assert np.allclose(posed_depth.read(tmp_path).scan.points[:, 0], FAR)
    for line, told in (("1 0 0 0 0 0 0 0", "holds no pose in the line '1 0 0"), ("# none", "holds no pose$")):
        (tmp_path / "groundtruth.txt").write_text(line)
        with pytest.raises(checks.InputError, match=rf"groundtruth\.txt: {told}"):
            posed_depth.read(tmp_path)


def test_frames_that_do_not_stand_as_told_are_told(tmp_path: Path) -> None:
    scan, wrong = sphere_scan(12, 0.02, 0.1), tmp_path / "wrong"
    wrong.mkdir()
    for i, eye in enumerate(np.unique(scan.positions, axis=0)):
        own = scan.some((scan.positions == eye).all(axis=1))
        scans.write(own, tmp_path / f"{i}.npz")
        scans.write(scans.Scan(own.positions, -own.directions, own.ranges), wrong / f"{i}.npz")
    assert not posed_depth.read(tmp_path).scan.remarks
    assert "12 frames agree on 0% of what they see: are their poses right?" in posed_depth.read(wrong).told


def test_tum_without_a_camera_file_has_that_of_its_name(tmp_path: Path) -> None:
    folder = tmp_path / "rgbd_dataset_freiburg1_xyz"
    (folder / "depth").mkdir(parents=True)
    Image.fromarray(np.full((480, 640), 5000, np.uint16)).save(folder / "depth/1.png")
    (folder / "depth.txt").write_text("1.0 depth/1.png\n")
    (folder / "groundtruth.txt").write_text("1.0 0 0 0 0 0 0 1\n")
    found = posed_depth.read(folder)
    assert np.allclose(found.scan.points[0], [-318.6 / 517.3, -255.3 / 516.5, 1]) and "of freiburg1" in found.told
    assert "a guess" in posed_depth.read(folder.rename(tmp_path / "room")).told


def test_nerfstudio(tmp_path: Path) -> None:
    frames = []
    for i, pose in enumerate(POSES @ np.diag([1.0, -1, -1, 1])):  # looking along Z by OpenGL's axes
        depths(tmp_path / f"depth/{i}.png", 0.001)
        frames.append({"file_path": f"images/{i}.png", "depth_file_path": f"depth/{i}.png"})
        frames[-1]["transform_matrix"] = pose.tolist()
    camera = {"fl_x": 2 * FOCAL, "fl_y": 2 * FOCAL, "cx": WIDTH, "cy": HEIGHT, "w": 2 * WIDTH, "h": 2 * HEIGHT}
    (tmp_path / "transforms.json").write_text(json.dumps({**camera, "frames": frames}))  # of images twice as fine
    _check_wall(posed_depth.read(tmp_path))


def test_redwood(tmp_path: Path) -> None:
    lines = []
    for i, pose in enumerate(POSES):
        depths(tmp_path / f"depth/{i:05d}.png", 0.001)
        lines += [f"{i} {i} {i + 1}", *(" ".join(f"{value:.8f}" for value in row) for row in pose)]
    (tmp_path / "trajectory.log").write_text("\n".join(lines))
    open3d_camera(tmp_path)
    _check_wall(posed_depth.read(tmp_path))


def test_scans_in_a_folder_are_one(tmp_path: Path) -> None:
    matrix = [[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]]
    depth = np.full((HEIGHT, WIDTH), FAR)
    depth[0, 0] = 0
    for i, pose in enumerate(POSES):
        np.savez(tmp_path / f"{i}.npz", depth=depth, intrinsics=matrix, camera_to_scan=pose)
        depth[0, 0] = np.nan  # of the second
    _check_wall(posed_depth.read(tmp_path))
    np.savez(tmp_path / "2.npz", depth=depth, intrinsics=matrix)
    nothing, unknown = posed_depth.read(tmp_path).scan.remarks
    assert nothing.startswith("of 48 ranges 1 are 0: ") and unknown.startswith("of 96 ranges 2 are nan: ")


def test_many_pixels_are_thinned_about_the_same_axis(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    depths(tmp_path / "depth/0.png", 0.001)
    (tmp_path / "a.log").write_text("0 0 1\n" + "\n".join(" ".join(map(str, row)) for row in np.eye(4)))
    open3d_camera(tmp_path)
    whole = posed_depth.read(tmp_path).scan
    monkeypatch.setattr(posed_depth, "_MOST", HEIGHT * WIDTH // 4)
    fewer = posed_depth.read(tmp_path).scan
    assert {tuple(p) for p in fewer.points.round(9)} <= {tuple(p) for p in whole.points.round(9)}
    assert len(fewer.ranges) == HEIGHT * WIDTH // 4 - 1


POINTS = np.array([[1.0, 0, 0], [0, 2, 0], [0, 0, 4], [1, 1, 1]], np.float32)


def test_kitti(tmp_path: Path) -> None:
    np.append(POINTS, np.full((4, 1), 0.5, np.float32), axis=1).tofile(tmp_path / "000000.bin")
    found = posed_depth.read(tmp_path / "000000.bin")
    assert np.allclose(found.scan.points, POINTS) and not found.scan.positions.any()
    (tmp_path / "cut.bin").write_bytes(b"123")
    with pytest.raises(checks.InputError, match=r"cut\.bin: 3 bytes"):
        posed_depth.read(tmp_path / "cut.bin")


@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_pcd(tmp_path: Path, encoding: str) -> None:
    head = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH 4\nHEIGHT 1\nVIEWPOINT 0 0 -1 1 0 0 0\nPOINTS 4\nDATA {encoding}\n"
    ).encode()
    if encoding == "ascii":
        body = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS).encode()
    else:
        body = POINTS.tobytes()
        if encoding == "binary_compressed":  # columns one after the other, as LZF runs of literals
            body, whole = b"", POINTS.T.tobytes()
            for first in range(0, len(whole), 32):
                run = whole[first : first + 32]
                body += bytes([len(run) - 1]) + run
            body = np.array([len(body), len(whole)], "<u4").tobytes() + body
    (tmp_path / "cloud.pcd").write_bytes(head + body)
    scan = posed_depth.read(tmp_path / "cloud.pcd").scan
    assert np.allclose(scan.points, POINTS) and np.array_equal(scan.positions, np.tile([0.0, 0, -1], (4, 1)))


def test_clouds_of_other_makers() -> None:
    found = [posed_depth.read(CLOUDS / f"{name}.pcd").scan for name in ("ascii", "binary", "binary_compressed")]
    assert [len(scan.points) for scan in found] == [213] * 3
    assert all(np.allclose(scan.points, found[0].points, atol=1e-5) for scan in found)
    assert np.allclose(found[0].points[0], [0.93773, 0.33763, 0])
    with pytest.raises(checks.InputError, match=r"autzen\.las: .* it needs NormalX, NormalY, NormalZ"):
        posed_depth.read(CLOUDS / "autzen.las")


def test_ply_with_normals_needs_no_sensor(tmp_path: Path) -> None:
    (tmp_path / "none.ply").write_bytes(mesh_io.points_ply(POINTS.astype(float), np.zeros((4, 3))))
    with pytest.raises(checks.InputError, match=r"none.ply: its points with normals span nothing"):
        posed_depth.read(tmp_path / "none.ply")
    normals = np.tile([0.0, 0, 2.0], (4, 1))
    (tmp_path / "cloud.ply").write_bytes(mesh_io.points_ply(POINTS.astype(float), normals))
    found = posed_depth.read(tmp_path / "cloud.ply")
    assert not found.sensed and np.allclose(found.scan.points, POINTS)
    assert np.allclose(found.scan.directions, [0, 0, -1])
    assert posed_depth.is_rays(tmp_path / "cloud.ply")


EAST = np.array([5e5, 0.0, 0.0])


def las(path: Path, names: Sequence[str]) -> None:
    """POINTS far from 0, as of a map, and extra dimensions that are all 2."""
    header = laspy.LasHeader(point_format=3, version="1.4")
    header.offsets, header.scales = EAST, np.full(3, 1e-3)
    header.add_extra_dims([laspy.ExtraBytesParams(name, "f4") for name in names])
    cloud = laspy.LasData(header)
    cloud.xyz = POINTS + EAST
    for name in names:
        cloud[name] = np.full(4, 2.0)
    cloud.write(str(path))


def test_las(tmp_path: Path) -> None:
    las(tmp_path / "a.las", ["NormalX", "NormalY", "NormalZ"])
    found = posed_depth.read(tmp_path / "a.las")
    assert not found.sensed and np.allclose(found.scan.points, POINTS + EAST, rtol=0, atol=1e-9)
    assert np.allclose(found.scan.directions, -(3**-0.5))
    las(tmp_path / "b.las", ["NormalX"])
    with pytest.raises(checks.InputError, match=r"b\.las: .* it needs NormalX, NormalY, NormalZ"):
        posed_depth.read(tmp_path / "b.las")
    (tmp_path / "c.las").write_bytes((tmp_path / "a.las").read_bytes()[:-50])
    with pytest.raises(checks.InputError, match=r"c\.las: "):
        posed_depth.read(tmp_path / "c.las")


@pytest.mark.parametrize("seed", range(40))
def test_a_damaged_las_is_read_or_refused(tmp_path: Path, seed: int) -> None:
    las(tmp_path / "a.las", ["NormalX", "NormalY", "NormalZ"])
    data, rng = bytearray((tmp_path / "a.las").read_bytes()), np.random.default_rng(seed)
    for place in rng.integers(0, 400 if seed % 2 else len(data), 3):
        data[place] = rng.integers(256)
    (tmp_path / "a.las").write_bytes(data)
    try:
        posed_depth.read(tmp_path / "a.las")
    except checks.InputError as refused:
        assert "a.las" in str(refused)


def _frame(path: object = "d.png", **other: object) -> bytes:
    """A transforms.json of one frame."""
    camera = {"fl_x": 9, "fl_y": 9, "cx": 4, "cy": 3, "w": 8, "h": 6, "transform_matrix": np.eye(4).tolist()}
    return json.dumps(camera | other | {"frames": [{"depth_file_path": path}]}).encode()


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.las", b"LASF", "is not read as LAS: File is to small"),
        ("b.las", b"LASF" + b"\xff" * 400, "its header claims more than it holds"),
        ("a.pcd", b"nothing", "holds no points"),
        ("folder/x.txt", b"", "a folder of depth images has"),
        ("folder/transforms.json", b'{"frames": [{"depth_file_path": "d.png"}]}', "a frame needs depth_file_path"),
        ("folder/transforms.json", b"[]", "must be an object with frames"),
        ("folder/transforms.json", _frame(depth_unit_scale_factor="mm"), "depth_unit_scale_factor must be a number"),
        ("folder/transforms.json", _frame(depth_unit_scale_factor=-1), r"must be above 0; got \(-1.0, 9"),
        ("folder/transforms.json", _frame(k1=-0.3, p2=0.1), "k1 -0.3, p2 0.1: lenses that bend"),
        ("folder/transforms.json", _frame(camera_model="OPENCV_FISHEYE"), "camera_model OPENCV_FISHEYE: lenses"),
        ("folder/groundtruth.txt", b"1 2 3", "depth.txt: is not there"),
        ("folder/t.log", b"0 0 1\n1 0 0 0", "five lines a pose"),
    ],
)
def test_refusals_name_the_file(tmp_path: Path, name: str, content: bytes, told: str) -> None:
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(content)
    with pytest.raises(checks.InputError, match=told) as refused:
        posed_depth.read(file.parent if file.parent.name == "folder" else file)
    assert str(file.parent) in str(refused.value)

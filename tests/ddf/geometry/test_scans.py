"""Scans of every kind: as the rays that they are, less what has no range, or refused in one line."""

import json
import tracemalloc
import zipfile

import numpy as np
import pytest
from PIL import Image

from ddf.cli import results
from ddf.core import checks
from ddf.geometry import scans, transforms

INTRINSICS = np.array([[40.0, 0, 15.0], [0, 50.0, 12.0], [0, 0, 1]])
TURN = transforms.Similarity(1.0, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([1.0, 2.0, 3.0]))


def _depth():
    """Of a plane at z = 2, with one pixel that saw nothing and one without an answer."""
    depth = np.full((24, 30), 2.0)
    depth[3, 4], depth[5, 6] = np.inf, 0.0
    return depth


@pytest.mark.parametrize("seed", range(20))
def test_pixels_of_any_camera_anywhere_are_the_rays_of_a_loop_over_them(seed):
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    place = transforms.Similarity(1.0, turn * np.linalg.det(turn), rng.normal(size=3) * 10.0 ** rng.integers(-1, 7))
    height, width = (int(side) for side in rng.integers(4, 12, 2))
    fx, fy = rng.uniform(0.6, 3, 2) * width
    cx, cy = np.array([width, height]) * (0.5 + rng.uniform(-0.09, 0.09, 2))
    skew, depth = rng.uniform(-0.5, 0.5), rng.uniform(0.1, 9, (height, width))
    depth.flat[1], depth.flat[2] = np.inf, 0.0  # a pixel that saw nothing, and one without an answer
    scan = scans.of_depth(depth, [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], place.to_matrix())
    ways = []
    for row, column in np.ndindex(height, width):
        y = (row + 0.5 - cy) / fy
        ways.append([(column + 0.5 - cx - skew * y) / fx, y, 1.0])
    ways = np.delete(ways, 2, axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    np.testing.assert_allclose(scan.directions, ways @ place.rotation.T / lengths[:, None], atol=1e-9)
    np.testing.assert_allclose(scan.ranges, np.delete(depth, 2) * lengths, rtol=1e-9)
    np.testing.assert_allclose(scan.positions, np.broadcast_to(place.translation, scan.positions.shape))


def test_the_three_kinds_of_file_are_one_scan(tmp_path):
    scan = scans.of_depth(_depth(), INTRINSICS, TURN.to_matrix())
    scans.write(scan, tmp_path / "rays.npz")
    swapped = np.asfortranarray(_depth().astype(">f8"))
    np.savez(tmp_path / "depth.npz", depth=swapped, intrinsics=INTRINSICS, camera_to_scan=TURN.to_matrix())
    np.savez(tmp_path / "points.npz", points=scan.points, sensors=TURN.translation)
    rays, image, points = (scans.read(tmp_path / f"{name}.npz") for name in ("rays", "depth", "points"))
    for one in (rays, image):
        np.testing.assert_array_equal(one.ranges, scan.ranges)
        np.testing.assert_allclose(one.directions, scan.directions)
    np.testing.assert_allclose(points.ranges, scan.ranges[scan.hit])
    np.testing.assert_allclose(points.points, scan.points)


LENS = {"depth": _depth(), "intrinsics": INTRINSICS}
CLOUD = {"points": np.ones((3, 3)), "sensors": np.zeros(3)}
RAY = {"positions": [[0, 0, 0]], "directions": [[0, 0, 1]], "ranges": [1]}
TWICE = INTRINSICS * [[2], [2], [1]]
BAD = {
    "no scan": ({"depth": _depth()}, "a scan has one of positions and directions and ranges"),
    "two kinds": (LENS | CLOUD, "one of .* got depth, intrinsics, p"),
    "unknown array": (LENS | {"camera_to_world": np.eye(4)}, "unknown key 'camera_to_world'.*mean camera_to_scan"),
    "points with a camera": (CLOUD | {"camera_to_scan": np.eye(4)}, "points: unknown key 'camera_to_scan'"),
    "NaN start": (RAY | {"positions": [[0, 0, np.nan]]}, "must be finite"),
    "too few": (RAY | {"positions": np.zeros((2, 3)), "directions": [[0, 0, 1]] * 2}, "one a ray"),
    "negative depths": (LENS | {"depth": -_depth() - np.eye(24, 30)}, r"above 0.* got -3 at \(0, 0\), .*write 0"),
    "no focal length": (LENS | {"intrinsics": np.diag([0.0, 1, 1])}, "fx, fy above 0"),
    "singular": (LENS | {"intrinsics": INTRINSICS * [[1], [1], [0]]}, r"\[0, 0, 1\]\] with"),
    "lower entry": (LENS | {"intrinsics": INTRINSICS + np.eye(3, k=-1) * 3}, r"\[0, fy, cy\]"),
    "transposed": (LENS | {"intrinsics": INTRINSICS.T}, "these stand transposed"),
    "intrinsics (3, 4)": (LENS | {"intrinsics": np.eye(3, 4)}, "intrinsics must be"),
    "image of twice the size": (LENS | {"intrinsics": TWICE}, "of another image than 30 x 24"),
    "image of half the size": (LENS | {"intrinsics": INTRINSICS * [[0.5], [0.5], [1]]}, "tell width and height"),
    "turned image": (LENS | {"intrinsics": INTRINSICS[[1, 0, 2]][:, [1, 0, 2]]}, "of another image"),
    "size of another": (LENS | {"width": 60, "height": 48}, r"another width or height \(48, 60\) than 30 x 24"),
    "scaled camera": (LENS | {"camera_to_scan": np.diag([2.0, 2, 2, 1])}, "without a scale"),
    "camera by columns": (LENS | {"camera_to_scan": TURN.to_matrix().T}, "last row: transpose it"),
    "other sensors": (CLOUD | {"sensors": np.zeros((2, 3))}, r"sensors must be \(3,\)"),
    "NaN sensor": (CLOUD | {"sensors": np.full(3, np.nan)}, "sensors must be finite"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_scans_are_one_line_that_names_the_file(name, tmp_path):
    arrays, message = BAD[name]
    with zipfile.ZipFile(tmp_path / "bad.npz", "w") as archive:
        for key, value in arrays.items():
            with archive.open(f"{key}.npy", "w") as member:
                np.lib.format.write_array(member, np.asarray(value, dtype=np.float64))
    with pytest.raises(checks.InputError, match=message) as raised:
        scans.read(tmp_path / "bad.npz")
    assert "bad.npz" in str(raised.value) and "\n" not in str(raised.value)


def _written(folder, arrays):
    np.savez(folder / "scan.npz", **arrays)
    return folder / "scan.npz"


NONE = {"nan": np.nan, "-1": -1.0, "0": 0.0, "65535": 65535.0, "1e10 or more": 1e10, " 1e10 or more": 3.4e38}


@pytest.mark.parametrize("value", NONE)
@pytest.mark.parametrize("kind", ["rays", "depth"])
def test_what_is_no_range_is_left_out_and_told_alike_in_rays_and_depths(kind, value, tmp_path):
    whole = scans.of_depth(_depth(), INTRINSICS, TURN.to_matrix())
    holes = np.arange(len(whole.ranges)) % 3 == 0
    if kind == "rays":
        arrays = {"positions": whole.positions, "directions": whole.directions}
        arrays["ranges"] = np.where(holes, NONE[value], whole.ranges)
    else:
        depth = _depth()
        depth.ravel()[np.flatnonzero(depth)[holes]] = NONE[value]
        arrays = {"depth": depth, "intrinsics": INTRINSICS, "camera_to_scan": TURN.to_matrix()}
    scan = scans.read(_written(tmp_path, arrays))
    for name in ("positions", "directions", "ranges"):
        np.testing.assert_array_equal(getattr(scan, name), getattr(whole, name)[~holes])
    (told,) = scan.remarks
    assert f"{holes.sum() + (kind == 'depth' and value == '0')} are {value.strip()}" in told and "left out" in told


def test_points_that_are_none_are_left_out_of_rows_and_of_organised_clouds(tmp_path):
    rng = np.random.default_rng(0)
    points, sensor = rng.normal(size=(6, 7, 3)), np.array([0.0, 0, 9])
    whole = scans.of_points(points.reshape(-1, 3), sensor)
    assert not whole.remarks
    read = scans.read(_written(tmp_path, {"points": points, "sensors": sensor}))
    np.testing.assert_allclose(read.points, whole.points)
    points[0, 0, 1], points[1, 1, 2], points[2, 2], points[3, 3:5] = np.nan, np.inf, sensor, 0.0
    places = np.broadcast_to(sensor, points.shape).copy()
    places[0, 0] = np.nan
    kept = np.setdiff1d(np.arange(42), [0, 8, 16, 24, 25])
    scan = scans.read(_written(tmp_path, {"points": points, "sensors": places}))
    np.testing.assert_allclose(scan.points, whole.points[kept])
    assert scan.remarks == ("of 42 ranges 2 are nan, 3 are 0: no return, left out",)


def test_intrinsics_of_a_cropped_image_are_used_where_its_size_is_told(tmp_path):
    depth = np.full((8, 10), 2.0)
    told = {"depth": depth, "intrinsics": INTRINSICS, "width": 10, "height": 8}
    whole = scans.of_depth(np.full((24, 30), 2.0), INTRINSICS)
    cropped = whole.directions.reshape(24, 30, 3)[:8, :10].reshape(-1, 3)
    np.testing.assert_allclose(scans.read(_written(tmp_path, told)).directions, cropped, atol=1e-15)


def test_of_more_depths_than_are_read_whole_rows_and_columns_are_left_out(monkeypatch):
    whole, depth = scans.of_depth(np.full((24, 30), 2.0), INTRINSICS), np.full((24, 30), 2.0)
    monkeypatch.setattr(scans, "_MOST_RAYS", 200)
    scan = scans.of_depth(depth, INTRINSICS)
    np.testing.assert_array_equal(scan.directions, whole.directions.reshape(24, 30, 3)[::2, ::2].reshape(-1, 3))
    assert scan.remarks == ("720 depths: of every 2 rows and columns one is read",)


def test_a_depth_image_takes_25_bytes_a_pixel_at_most(tmp_path, monkeypatch):
    monkeypatch.setattr(scans, "_MOST_RAYS", 500_000)  # as many as of 12 megapixels
    lens = {"intrinsics": [[2e3, 0, 1e3], [0, 2e3, 750], [0, 0, 1]]}
    path = _png(tmp_path, np.full((1500, 2000), 1500, np.uint16), lens)
    scans.read(path)
    tracemalloc.start()
    assert len(scans.read(path).ranges) > 300_000
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 25 * 3e6  # 300 MB of 12 megapixels


def test_an_array_that_is_twice_in_a_file_is_refused(tmp_path):
    path = _written(tmp_path, LENS)
    with zipfile.ZipFile(path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("depth.npy", archive.read("depth.npy"))
    with pytest.raises(checks.InputError, match="has an array twice"):
        scans.read(path)


def _png(folder, steps, said):
    Image.fromarray(steps).save(folder / "view.png")
    if said is not None:
        (folder / "view.json").write_text(said if isinstance(said, str) else json.dumps(said), encoding="utf-8-sig")
    return folder / "view.png"


@pytest.mark.parametrize(("said", "scale"), [({}, 0.001), ({"depth_scale": 0.0002}, 0.0002)])
def test_png_of_16_bits_is_the_depth_image_in_metres(said, scale, tmp_path):
    steps = np.round(np.nan_to_num(_depth(), posinf=0) / scale).astype(np.uint16)
    place = {"intrinsics": INTRINSICS.tolist(), "camera_to_scan": TURN.to_matrix().tolist()}
    scan = scans.read(_png(tmp_path, steps, place | said))
    whole = scans.of_depth(steps * scale, INTRINSICS, TURN.to_matrix())
    assert len(scan.ranges) == 24 * 30 - 2
    np.testing.assert_allclose(scan.points, whole.points, rtol=1e-12)
    np.testing.assert_allclose(TURN.inverse().apply(scan.points)[:, 2], 2.0, rtol=0, atol=scale)


@pytest.mark.parametrize("said", [{}, {"depth_scale": 2.5 / 65535}])
def test_our_own_png_of_depth_is_read_along_its_rays_by_the_step_that_it_says(said, tmp_path):
    truth = scans.of_depth(np.full((24, 30), 2.0), INTRINSICS)
    ranges = truth.ranges.reshape(24, 30) * 2.5 / truth.ranges.max()
    ranges[0, 1] = np.inf
    data, step = results.depth_png(ranges)
    (tmp_path / "view.png").write_bytes(data)
    (tmp_path / "view.json").write_text(json.dumps(SAID | said))
    scan = scans.read(tmp_path / "view.png")
    np.testing.assert_allclose(scan.ranges, np.delete(ranges.ravel(), 1), rtol=0, atol=step)
    assert scan.ranges.max() == pytest.approx(2.5) and "1 are 0" in scan.remarks[0]
    with pytest.raises(checks.InputError, match=r"depth_scale is 0\.001, but view.png says"):
        (tmp_path / "view.json").write_text(json.dumps(SAID | {"depth_scale": 0.001}))
        scans.read(tmp_path / "view.png")


GREY, SAID = np.full((24, 30), 2000, np.uint16), {"intrinsics": INTRINSICS.tolist()}
BAD_PNG = {
    "no JSON": (GREY, None, "needs view.json beside it"),
    "8 bits": (GREY.astype(np.uint8), SAID, "16 bits"),
    "broken JSON": (GREY, "{", "view.json: not valid JSON"),
    "deep JSON": (GREY, "[" * 100_000, "view.json: not valid JSON"),
    "a list": (GREY, "[]", "must be a JSON object"),
    "no intrinsics": (GREY, {"depth_scale": 1}, "intrinsics"),
    "words": (GREY, SAID | {"depth_scale": "0.001"}, "depth_scale must be a number; got '0.001'"),
    "scale": (GREY, SAID | {"depth_scale": 0}, "must be above 0, 100 at most; got 0"),
    "inverse scale": (GREY, SAID | {"depth_scale": 1000}, "perhaps its inverse, 0.001, is meant"),
    "unknown key": (GREY, SAID | {"camera_to_world": 1}, r"'camera_to_world'.*\(did you mean camera_to_scan\?\)"),
    "ragged": (GREY, {"intrinsics": [[40, 0], [0], 1]}, "intrinsics must be a 3x3 matrix of numbers"),
}


@pytest.mark.parametrize("name", BAD_PNG)
def test_bad_pngs_are_one_line_that_names_the_file(name, tmp_path):
    steps, said, message = BAD_PNG[name]
    with pytest.raises(checks.InputError, match=message) as raised:
        scans.read(_png(tmp_path, steps, said))
    assert "view." in str(raised.value) and "\n" not in str(raised.value)


def test_a_cut_png_and_one_that_is_none_are_told(tmp_path):
    path = _png(tmp_path, GREY, SAID)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(checks.InputError, match="not a readable PNG"):
        scans.read(path)
    with pytest.raises(FileNotFoundError):
        scans.read(tmp_path / "none.png")

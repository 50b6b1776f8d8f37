import json
import zipfile

import numpy as np
import pytest
from PIL import Image

from ddf.core import checks
from ddf.geometry import scans, transforms

INTRINSICS = np.array([[40.0, 0, 15.0], [0, 50.0, 12.0], [0, 0, 1]])
TURN = transforms.Similarity(1.0, np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([1.0, 2.0, 3.0]))


def _depth():
    """Of a plane at z = 2, with one pixel that saw nothing and one without an answer."""
    depth = np.full((24, 30), 2.0)
    depth[3, 4], depth[5, 6] = np.inf, 0.0
    return depth


def test_depth_image_is_rays_whose_hits_lie_on_the_plane_and_project_to_their_pixels():
    scan = scans.of_depth(_depth(), INTRINSICS, TURN.to_matrix())
    assert len(scan.ranges) == 24 * 30 - 1 and (~scan.hit).sum() == 1
    local = TURN.inverse().apply(scan.points)
    np.testing.assert_allclose(local[:, 2], 2.0, rtol=0, atol=1e-12)
    pixels = local @ INTRINSICS.T / local[:, 2:]
    rows, columns = np.nonzero(np.isfinite(_depth()) & (_depth() > 0))
    np.testing.assert_allclose(pixels[:, :2], np.stack((columns, rows), 1) + 0.5, rtol=0, atol=1e-10)
    np.testing.assert_allclose(scan.positions, np.broadcast_to(TURN.translation, scan.positions.shape))


def test_the_three_kinds_of_file_are_one_scan(tmp_path):
    scan = scans.of_depth(_depth(), INTRINSICS, TURN.to_matrix())
    scans.write(scan, tmp_path / "rays.npz")
    np.savez(tmp_path / "depth.npz", depth=_depth(), intrinsics=INTRINSICS, camera_to_scan=TURN.to_matrix())
    np.savez(tmp_path / "points.npz", points=scan.points, sensors=TURN.translation)
    rays, image, points = (scans.read(tmp_path / f"{name}.npz") for name in ("rays", "depth", "points"))
    for one in (rays, image):
        np.testing.assert_allclose(one.ranges, scan.ranges)
        np.testing.assert_allclose(one.directions, scan.directions)
    np.testing.assert_allclose(points.ranges, scan.ranges[scan.hit])
    np.testing.assert_allclose(points.points, scan.points)


BAD = {
    "no scan": ({"depth": _depth()}, "a scan has positions and directions and ranges"),
    "NaN range": ({"positions": [[0, 0, 0]], "directions": [[0, 0, 1]], "ranges": [np.nan]}, "ranges must be above 0"),
    "range of 0": ({"positions": [[0, 0, 0]], "directions": [[0, 0, 1]], "ranges": [0.0]}, "got 0.0 at ray 0"),
    "NaN start": ({"positions": [[0, 0, np.nan]], "directions": [[0, 0, 1]], "ranges": [1]}, "must be finite"),
    "too few": ({"positions": np.zeros((2, 3)), "directions": [[0, 0, 1]] * 2, "ranges": [1]}, "one a ray"),
    "NaN depth": ({"depth": np.full((4, 4), np.nan), "intrinsics": INTRINSICS}, "without NaN"),
    "no focal length": ({"depth": _depth(), "intrinsics": np.diag([0.0, 1, 1])}, "fx, fy above 0"),
    "another image": ({"depth": _depth()[:8, :8], "intrinsics": INTRINSICS}, "of another image than 8 x 8"),
    "focal in metres": ({"depth": _depth(), "intrinsics": INTRINSICS * [[1e-3], [1e-3], [1]]}, "of another image"),
    "scaled camera": (
        {"depth": _depth(), "intrinsics": INTRINSICS, "camera_to_scan": np.diag([2.0, 2, 2, 1])},
        "without a scale",
    ),
    "point at its sensor": ({"points": np.ones((3, 3)), "sensors": np.ones(3)}, "away from its sensor"),
    "other sensors": ({"points": np.ones((3, 3)), "sensors": np.zeros((2, 3))}, r"sensors must be \(3,\)"),
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


def _png(folder, steps, said):
    Image.fromarray(steps).save(folder / "view.png")
    if said is not None:
        (folder / "view.json").write_text(said if isinstance(said, str) else json.dumps(said))
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


GREY, LENS = np.full((24, 30), 2000, np.uint16), {"intrinsics": INTRINSICS.tolist()}
BAD_PNG = {
    "no JSON": (GREY, None, "needs view.json beside it"),
    "8 bits": (GREY.astype(np.uint8), LENS, "16 bits"),
    "broken JSON": (GREY, "{", "view.json: must be a JSON object"),
    "a list": (GREY, "[]", "must be a JSON object"),
    "no intrinsics": (GREY, {"depth_scale": 1}, "intrinsics"),
    "words": (GREY, LENS | {"depth_scale": "mm"}, "must be a JSON object"),
    "scale": (GREY, LENS | {"depth_scale": 0}, "must be above 0; got 0.0"),
    "another image": (GREY[:8, :8], LENS, "view.json: intrinsics .* of another image than 8 x 8"),
}


@pytest.mark.parametrize("name", BAD_PNG)
def test_bad_pngs_are_one_line_that_names_the_file(name, tmp_path):
    steps, said, message = BAD_PNG[name]
    with pytest.raises(checks.InputError, match=message) as raised:
        scans.read(_png(tmp_path, steps, said))
    assert "view." in str(raised.value) and "\n" not in str(raised.value)


def test_a_cut_png_and_one_that_is_none_are_told(tmp_path):
    path = _png(tmp_path, GREY, LENS)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(checks.InputError, match="not a readable PNG"):
        scans.read(path)
    with pytest.raises(FileNotFoundError):
        scans.read(tmp_path / "none.png")

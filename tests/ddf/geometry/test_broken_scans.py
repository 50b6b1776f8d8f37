"""Random scans broken at random: each is what it was, less what has no range, or is refused in one line."""

import json
import math
import time
import zipfile

import numpy as np
import pytest
from PIL import Image

from ddf.cli import image_files
from ddf.core import checks, storage
from ddf.geometry import scans, transforms

COUNT = 200
REFUSED = None  # in place of the scan that is expected
NONE = (np.nan, -np.inf, 0.0, -1.0, 65535.0, 1e10, 3.4e38)
ODD = (None, True, "0.001", "", [], {}, [[1]], math.nan, math.inf, -1, 0, 1000, 5000.0, 10**400, 1e308, {"a": 1})


def turned(rng):
    """A random pose, far from 0 at times."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    return transforms.Similarity(1.0, turn, rng.normal(size=3) * 10.0 ** rng.integers(-1, 7))


def lens(rng, height, width):
    """Intrinsics whose principal point is near the middle."""
    middle = np.array([width, height]) * (0.5 + rng.uniform(-0.09, 0.09, 2))
    fx, fy = rng.uniform(0.6, 3, 2) * width
    return np.array([[fx, rng.uniform(-0.5, 0.5), middle[0]], [0, fy, middle[1]], [0, 0, 1.0]])


def expected(depth, matrix, place, step=1.0, along_rays=False):
    """The rays of an image, one pixel after the other."""
    rows = []
    for (row, column), value in np.ndenumerate(depth):
        y = (row + 0.5 - matrix[1, 2]) / matrix[1, 1]
        way = np.array([(column + 0.5 - matrix[0, 2] - matrix[0, 1] * y) / matrix[0, 0], y, 1.0])
        length = np.linalg.norm(way)
        rows.append((place.translation, place.rotation @ way / length, value * step * (1 if along_rays else length)))
    return [np.array(each) for each in zip(*rows, strict=True)]


def holes(rng, ranges, values):
    """Where one or two of the values that are no range stand, in place of some of the ranges."""
    where = rng.random(ranges.shape) < rng.choice([0, 0.1, 0.9])
    chosen = [value for value in rng.permutation(values)[:2] if not (value == -1 and ranges.dtype.kind == "u")]
    ranges[where] = rng.choice(chosen, where.sum()) if chosen else 0
    return where


def less(rays, left_out):
    return [each[~left_out.ravel()] for each in rays]


def rays(rng, path):
    """An NPZ of rays, in rows or as an image."""
    shape = (int(rng.integers(1, 40)),) if rng.random() < 0.5 else tuple(int(i) for i in rng.integers(1, 9, 2))
    along = rng.normal(size=(*shape, 3))
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    arrays = {"positions": rng.normal(size=(*shape, 3)), "directions": along, "ranges": rng.uniform(0.1, 9, shape)}
    arrays["ranges"][rng.random(shape) < 0.2] = np.inf
    true = [each.reshape(-1, 3) if each.ndim > len(shape) else each.ravel().copy() for each in arrays.values()]
    none = holes(rng, arrays["ranges"], NONE)
    arrays["directions"][none & (rng.random(shape) < 0.5)] = np.nan
    return broken_arrays(rng, path, arrays, less(true, none))


def depth(rng, path):
    """An NPZ of a depth image."""
    height, width = (int(i) for i in rng.integers(4, 12, 2))
    matrix, place = lens(rng, height, width), turned(rng)
    arrays = {"depth": rng.uniform(0.1, 9, (height, width)), "intrinsics": matrix}
    arrays["depth"][rng.random((height, width)) < 0.2] = np.inf
    if rng.random() < 0.5:
        arrays["camera_to_scan"] = place.to_matrix()
    else:
        place = transforms.Similarity()
    true = expected(arrays["depth"], matrix, place)
    wanted = less(true, holes(rng, arrays["depth"], NONE))
    arrays["intrinsics"], wrong = wrong_lens(rng, matrix, height, width)
    return broken_arrays(rng, path, arrays, REFUSED if wrong else wanted)


def points(rng, path):
    """An NPZ of points, in rows or organised, seen from one place or several."""
    shape = (int(rng.integers(1, 40)),) if rng.random() < 0.5 else tuple(int(i) for i in rng.integers(1, 9, 2))
    far = turned(rng).translation
    places = far + (rng.normal(size=3) if rng.random() < 0.5 else rng.normal(size=(*shape, 3)))
    arrays = {"points": far + rng.normal(size=(*shape, 3)), "sensors": places}
    seen_from = np.broadcast_to(places, (*shape, 3))
    way = arrays["points"] - seen_from
    length = np.linalg.norm(way, axis=-1)
    true = [seen_from.reshape(-1, 3), (way / length[..., None]).reshape(-1, 3), length.ravel()]
    none, at = rng.random(shape) < rng.choice([0, 0.1, 0.9]), rng.integers(0, 3)
    values = [np.nan, np.inf, 0.0 if none.sum() > 1 else np.nan]
    arrays["points"][none] = [values[at]] * 3 if rng.random() < 0.7 else seen_from[none]
    return broken_arrays(rng, path, arrays, less(true, none))


def wrong_lens(rng, matrix, height, width):
    """Intrinsics, mostly the right ones, and whether they are wrong."""
    lower = matrix.copy()
    lower[rng.integers(1, 3), 0] = 0.3
    wrong = (
        matrix * [[2], [2], [1]],
        matrix * [[0.5], [0.5], [1]],
        matrix.T,
        lower,
        matrix * [[1], [1], [0]],
        matrix * np.nan,
        -matrix,
        matrix * [[1 / width], [1 / height], [1]],
        matrix + np.outer([2 * width, 0, 0], [0, 0, 1]),
        matrix[:2],
    )
    kind = int(rng.integers(0, 3 * len(wrong)))
    return (wrong[kind], True) if kind < len(wrong) else (matrix, False)


def broken_arrays(rng, path, arrays, wanted):
    """Write them in some type and order, or with a fault; what is expected."""
    kind, keys = int(rng.integers(0, 16)), list(arrays)
    chosen = keys[int(rng.integers(0, len(keys)))]
    if kind == 0:
        arrays |= {str(rng.choice(["colours", "camera_to_world", "extrinsics", "K", "range"])): np.eye(4)}
        wanted = REFUSED
    elif kind == 1:
        arrays.pop(keys[int(rng.integers(0, 2))])
        wanted = REFUSED
    elif kind == 2:
        arrays[chosen] = arrays[chosen].astype(str) if rng.random() < 0.5 else arrays[chosen] > 0
        wanted = REFUSED
    elif kind == 3:
        arrays |= {"points": np.ones((3, 3)), "depth": np.ones((3, 3)), "ranges": np.ones(3)}
        wanted = REFUSED
    elif kind == 4:
        arrays[chosen] = arrays[chosen][..., :2] if chosen in ("points", "sensors") else arrays[chosen][None]
        wanted = REFUSED
    elif kind == 5:
        arrays = {key: np.asfortranarray(value.astype(">f8")) for key, value in arrays.items()}
    np.savez(path.with_suffix(".npz"), allow_pickle=False, **arrays)
    if kind == 6:
        with zipfile.ZipFile(path.with_suffix(".npz"), "a") as archive:
            archive.writestr(f"{chosen}.npy", archive.read(f"{chosen}.npy"))
        wanted = REFUSED
    return path.with_suffix(".npz"), wanted


def png(rng, path):
    """A PNG of 16 bits, of a sensor or of ours, and the JSON beside it."""
    height, width = (int(i) for i in rng.integers(4, 12, 2))
    matrix, place, ours = lens(rng, height, width), turned(rng), rng.random() < 0.4
    said = {"camera_to_scan": place.to_matrix().tolist(), "intrinsics": matrix.tolist()}
    if ours:
        ranges = rng.uniform(0.1, 9, (height, width))
        ranges[rng.random((height, width)) < 0.3] = np.inf
        ranges[0, 0] = 9.0
        data, step = image_files.depth_png(ranges)
        path.with_suffix(".png").write_bytes(data)
        levels = np.where(np.isfinite(ranges), np.rint(np.where(np.isfinite(ranges), ranges, 0) / step), 0)
        wanted = less(expected(levels, matrix, place, step, along_rays=True), ~np.isfinite(ranges))
    else:
        step = float(10.0 ** rng.integers(-5, 2))
        levels = rng.integers(1, 65535, (height, width)).astype(np.uint16)
        true = expected(levels, matrix, place, step)
        wanted = less(true, holes(rng, levels, (0, 65535)))
        Image.fromarray(levels).save(path.with_suffix(".png"))
        said["depth_scale"] = step
    intrinsics, wrong = wrong_lens(rng, matrix, height, width)
    said["intrinsics"], wanted = intrinsics.tolist(), REFUSED if wrong else wanted
    kind = int(rng.integers(0, 16))
    text = json.dumps(said)
    if kind == 0:
        text, wanted = text[:-1] + ', "intrinsics": [[1]]}', REFUSED
    elif kind == 1:
        text, wanted = json.dumps(said | {str(rng.choice(["extrinsics", "k1", "distortion", "scale"])): 0}), REFUSED
    elif kind == 2:
        place = [row[:] for row in said["camera_to_scan"]]
        place[int(rng.integers(0, 4))][int(rng.integers(0, 4))] = ODD[int(rng.integers(1, 6))]
        text, wanted = json.dumps(said | {"camera_to_scan": place}), REFUSED
    elif kind == 3:
        text = json.dumps({"depth_scale": ODD[int(rng.integers(0, 13))]} | {"intrinsics": said["intrinsics"]})
        wanted = REFUSED
    elif kind == 4:
        text, wanted = text[: int(rng.integers(0, len(text)))], REFUSED
    elif kind == 5:
        text, wanted = json.dumps(said | {"width": 2 * width}), REFUSED
    elif kind == 6 and not wrong:
        text = json.dumps(said | {"width": width, "height": height})
    path.with_suffix(".json").write_text(text, encoding=str(rng.choice(["utf-8", "utf-8-sig"])))
    return path.with_suffix(".png"), wanted


def pose(rng, path):
    """A file of `--pose`: the pose that is expected in place of a scan."""
    place = turned(rng)
    matrix = transforms.Similarity(float(rng.uniform(0.1, 9)), place.rotation, place.translation).to_matrix()
    kind, rows = int(rng.integers(0, 9)), matrix.tolist()
    odd = ODD[int(rng.integers(0, 14))]
    if kind == 0:
        rows[int(rng.integers(0, 4))][int(rng.integers(0, 4))] = ODD[int(rng.integers(0, 8))]
    contents = [rows, matrix.T.tolist(), matrix.ravel().tolist(), [rows], rows[:3], {"pose": rows}, odd]
    wanted = matrix if kind > 6 else REFUSED
    path.with_suffix(".json").write_text(json.dumps(contents[kind] if kind <= 6 else rows))
    return path.with_suffix(".json"), wanted


def read(path):
    """What is read of a file, arrays one after the other."""
    if path.suffix == ".json":
        return transforms.Similarity.of_matrix(f"{path}: the pose", storage.read_json(path)).to_matrix()
    scan = scans.read(path)
    return [scan.positions, scan.directions, scan.ranges]


def _trial(make, rng, folder):
    """One file: whether it was refused."""
    path, wanted = make(rng, folder / "scan")
    begin = time.process_time()
    try:
        found = read(path)
    except checks.InputError as fault:
        assert wanted is REFUSED, (str(fault), wanted)
        assert "\n" not in str(fault) and len(str(fault)) < 500 and "scan." in str(fault)
        return True
    finally:
        assert time.process_time() - begin < 5
    assert wanted is not REFUSED, path
    for one, other in zip(found, wanted, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
    return False


KINDS = (rays, depth, points, png, pose)


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
def test_broken_scans_are_what_they_were_or_refused_in_one_line(make, tmp_path):
    refused = sum(_trial(make, np.random.default_rng(seed), tmp_path) for seed in range(COUNT))
    assert COUNT / 8 < refused < 7 * COUNT / 8

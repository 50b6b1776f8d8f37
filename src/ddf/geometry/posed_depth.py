"""Many depth images with their poses in a folder, and clouds of points: what sensors and other programs write, as rays.

A folder holds one of
- `transforms.json` of nerfstudio: frames with `transform_matrix`, camera to world by OpenGL's axes (Y up, looking along
  -Z), and `depth_file_path` (PNG of 16 bits, or .npy), times `depth_unit_scale_factor` or `integer_depth_scale`;
- `depth.txt` and `groundtruth.txt` of TUM RGB-D: images by time, 1/5000 of a metre, poses as t and (x, y, z, w);
- `depth/*.png` and one `*.log` of Redwood and Open3D: millimetres, 4x4 camera to world after a line that begins with
  the image's number;
- or scans that `scans.read` reads, whose poses are their own.
TUM and Redwood write no intrinsics: those of a JSON file with Open3D's `intrinsic_matrix` in the folder are taken, else
TUM's own by the folder's name, else PrimeSense's. Their pixels have their centres at whole numbers, ours at halves.

A file is a scan of `scans.read`, or a cloud: KITTI .bin (x, y, z and intensity as float32, the sensor at 0), PCD (from
its VIEWPOINT), PLY (from 0), or LAS with the dimensions NormalX, NormalY, NormalZ. A cloud with normals needs no
sensor: it is seen from just above each point.
"""

import math
import os
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float, Num

from ddf.core import checks, storage
from ddf.geometry import mesh_io, scans, transforms

CLOUDS = (".bin", ".las", ".laz", ".pcd", ".ply")
_MOST = 4_000_000  # rays of a folder: of more, some whole rows and columns
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
_TUM_STEP, _MILLIMETRES = 1 / 5000, 0.001
_APART = 0.02  # seconds between an image and its pose, at most
_TUM = {  # fx, fy, cx, cy, pixels' centres at whole numbers
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
_LENS = ("k1", "k2", "k3", "k4", "p1", "p2", "camera_model")
_STRAIGHT = ("PINHOLE", "SIMPLE_PINHOLE", "OPENCV", "RADIAL", "SIMPLE_RADIAL")  # where all else is 0
_GUESS = "PrimeSense, a guess: put a JSON file beside with Open3D's intrinsic_matrix, 9 numbers by columns"
_PRIMESENSE = (525.0, 525.0, 319.5, 239.5)
_COUNT = re.compile(r"(?<![\d.])\d[\d,]*(?= ranges| are )")  # in a remark
_PAIRS, _HITS, _SLACK = 6, 200, 0.03  # of frames, of each, and of the way: compared; right within
_SEVERAL, _LITTLE = 5, 0.15  # frames; share that right ones agree on: .28 and more, wrong ones .1 and less
_ABOVE = 0.01  # of the longest side: from where a point with a normal is looked at
_LAS_HEAD, _LAS_NORMALS = 375, ("NormalX", "NormalY", "NormalZ")
_TURNED = 1e-3  # by how much a pose may differ from one of a rigid camera, which files round


@dataclass(frozen=True)
class Sensed:
    """What was read: rays, of what kind of files, how many of them; sensed: whether it is known from where."""

    scan: scans.Scan
    kind: str
    frames: int
    sensed: bool = True

    def require_sensed(self) -> None:
        """InputError where it is not known from where points were seen, so that only patches can be fitted."""
        if not self.sensed:
            raise checks.InputError(f"{self.kind} do not tell what is free; they are fitted by patches alone")

    @property
    def told(self) -> str:
        """What was understood of it, one line."""
        points, rays_ = self.scan.points, len(self.scan.ranges)
        sides = " x ".join(f"{side:.4g}" for side in np.ptp(points, axis=0)) if len(points) else "nothing"
        rest = "".join(f"; {each}" for each in self.scan.remarks[:3])
        return f"{self.kind}: frames {self.frames}, rays {rays_:,}, hits {len(points):,} in a box of {sides}{rest}"


@dataclass(frozen=True)
class _Frame:
    """A depth image to be read: unit of the scan in a step, intrinsics with centres at halves, camera to world."""

    file: Path
    step: float
    intrinsics: Float[np.ndarray, "3 3"]
    pose: Float[np.ndarray, "4 4"]
    size: tuple[float, float] | None = None  # width and height that the intrinsics are of, where they are told


def is_rays(path: Path) -> bool:
    """Whether a path is of rays and not of a mesh."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        return not mesh_io.has_faces(path)
    return path.is_dir() or suffix in (".npz", ".png", *CLOUDS)


def read(path: Path) -> Sensed:
    """The rays of a folder or a file; see the module."""
    suffix = path.suffix.lower()
    if path.is_dir():
        return _folder(path)
    if suffix not in CLOUDS:
        return Sensed(scans.read(path), "a scan", 1)
    points, normals, sensor = _CLOUDS[suffix](path)
    kept = np.isfinite(points).all(axis=1)
    if not kept.any():
        raise checks.InputError(f"{path}: holds no points")
    if normals is None:
        unit = " in metres" if suffix == ".bin" else ""
        return Sensed(scans.of_points(points[kept], sensor), f"points{unit} seen from {sensor.tolist()}", 1)
    length = np.linalg.norm(normals, axis=1)
    kept &= length > 0
    ways = -normals[kept] / length[kept, None]
    above = _ABOVE * float(np.ptp(points[kept], axis=0).max()) if kept.any() else 0.0
    if not above > 0:
        raise checks.InputError(f"{path}: its points with normals span nothing")
    scan = scans.Scan(points[kept] - above * ways, ways, np.full(len(ways), above))
    return Sensed(scan, "points with normals", 1, sensed=False)


def seen_from(folder: Path, paths: Sequence[Path]) -> list[str]:
    """Paths of rays as fit.json of a field's folder has them, for `ddf fit --onto`."""
    return [os.path.relpath(path.resolve(), folder.resolve()) for path in paths]


def together(found: Sequence[Sensed]) -> Sensed:
    """Several, all in one frame and unit, as one; they are `sensed` if all are."""
    if len(found) == 1:
        return found[0]
    kinds, frames = " and ".join(dict.fromkeys(each.kind for each in found)), sum(each.frames for each in found)
    return Sensed(_joined([each.scan for each in found]), kinds, frames, all(each.sensed for each in found))


def _folder(path: Path) -> Sensed:
    """All images of a folder as one scan."""
    if (path / "transforms.json").is_file():
        kind, frames = "nerfstudio's depth images in the unit of its poses", list(_nerfstudio(path))
    elif (path / "groundtruth.txt").is_file():
        intrinsics, whose = _intrinsics(path)
        kind, frames = f"TUM's depth images in metres, intrinsics of {whose}", list(_tum(path, intrinsics))
    elif logs := sorted(path.glob("*.log")):
        intrinsics, whose = _intrinsics(path)
        kind = f"Redwood's depth images in metres, intrinsics of {whose}"
        frames = list(_redwood(path, logs[0], intrinsics))
    else:
        files = sorted(each for each in path.iterdir() if each.suffix.lower() in (".npz", ".png"))
        if not files:
            wanted = "transforms.json, groundtruth.txt with depth.txt, a trajectory .log with depth/, or scans"
            raise checks.InputError(f"{path}: a folder of depth images has {wanted}; this one has none of them")
        return Sensed(_joined([scans.read(each) for each in files]), "scans", len(files))
    if not frames:
        raise checks.InputError(f"{path}: no depth image has a pose; nerfstudio's frames name theirs, depth_file_path")
    every = math.ceil(math.sqrt(len(frames) * _steps(frames[0].file).size / _MOST))
    try:
        return Sensed(_joined([_frame(each, every) for each in frames]), kind, len(frames))
    except checks.InputError as error:
        raise checks.InputError(f"{error}; intrinsics are of {_GUESS}" if _GUESS in kind else str(error)) from error


def _joined(parts: list[scans.Scan]) -> scans.Scan:
    columns = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("positions", "directions", "ranges")
    )
    counts: dict[str, list[list[int]]] = {}  # of the same words with other numbers: these are added up
    for remark in (remark for part in parts for remark in part.remarks):
        numbers = [int(number.replace(",", "")) for number in _COUNT.findall(remark)]
        counts.setdefault(_COUNT.sub("{:,}", remark), []).append(numbers)
    remarks = (words.format(*map(sum, zip(*rows, strict=True))) for words, rows in counts.items())
    return scans.Scan(*columns, remarks=(*_disagreement(parts), *remarks))


def _disagreement(parts: list[scans.Scan]) -> list[str]:
    """A remark where frames see through what others see, or many see little of it: they do not stand as told."""
    from scipy import spatial  # not where a file is read

    fixed = [part for part in parts if part.hit.any() and not np.ptp(part.positions, axis=0).any()]
    if len(fixed) < 2:
        return []
    first = np.linspace(0, len(fixed) - 2, _PAIRS).astype(int)  # and the next, which sees nearly the same
    frames = [(part, spatial.cKDTree(part.directions)) for part in map(fixed.__getitem__, {*first, *first + 1})]
    counts = np.zeros(4)
    for own, _ in frames:
        points, beyond = own.points[:: 1 + int(own.hit.sum()) // _HITS], []
        for other, tree in (each for each in frames if each[0] is not own):
            way = points - other.positions[0]
            far = np.linalg.norm(way, axis=1).clip(1e-300)
            gap = float(np.median(tree.query(other.directions[:: 1 + len(other.ranges) // _HITS], 2)[0][:, 1]))
            ray = tree.query(way / far[:, None], distance_upper_bound=gap)[1]
            beyond.append(np.append(other.ranges, np.nan)[ray] / far - 1)
        same = np.abs(beyond) <= _SLACK
        counts += len(points), same.any(axis=0).sum(), same.sum(), (np.array(beyond) > _SLACK).sum()
    hits, agree, same, through = counts
    if (len(fixed) < _SEVERAL or agree >= _LITTLE * hits) and through <= max(same, 0.1 * hits):
        return []
    check = "see whether they lead from camera to world, by the axes of their format, in the unit of the depths"
    return [f"{len(fixed)} frames agree on {agree / hits:.0%} of what they see: are their poses right? {check}"]


def _frame(frame: _Frame, every: int) -> scans.Scan:
    """The rays of an image, of every so many rows and columns one."""
    steps, matrix = _steps(frame.file), frame.intrinsics.copy()
    if frame.size is not None:  # depth is often coarser than the image that the intrinsics are of
        matrix[:2] *= np.array(steps.shape[::-1])[:, None] / np.array(frame.size)[:, None]
    matrix[:2, 2] += (every - 1) / 2
    matrix[:2] /= every
    pose = transforms.Similarity.of_matrix(f"{frame.file}: its pose", frame.pose, _TURNED)
    rigid = pose if abs(pose.scale - 1) > _TURNED else transforms.Similarity(1.0, pose.rotation, pose.translation)
    try:
        return scans.of_depth(steps[::every, ::every], matrix, rigid.to_matrix(), scale=frame.step)
    except checks.InputError as error:
        raise checks.InputError(f"{frame.file}: {error}") from error


def _steps(file: Path) -> Num[np.ndarray, "h w"]:
    """The depths of an image as its file has them."""
    if not file.is_file():
        raise checks.InputError(f"{file}: this depth image is not there")
    if file.suffix.lower() == ".npy":
        try:
            return np.squeeze(np.load(file, allow_pickle=False))
        except (ValueError, EOFError) as error:
            raise checks.InputError(f"{file}: not a readable array ({error})") from error
    return scans.grey(file)[0]


def _nerfstudio(path: Path) -> Iterator[_Frame]:
    file = path / "transforms.json"
    said = storage.read_json(file)
    frames = said.get("frames") if isinstance(said, dict) else None
    if not isinstance(frames, list) or not all(isinstance(frame, dict) for frame in frames):
        raise checks.InputError(f"{file}: must be an object with frames, which are objects")
    key = next((name for name in ("depth_unit_scale_factor", "integer_depth_scale") if name in said), "a step")
    step = float(checks.require_numbers(f"{file}: {key}", said.get(key, _MILLIMETRES), ()))
    for frame in frames:
        own = said | frame
        if "depth_file_path" in frame:
            names = ("fl_x", "fl_y", "cx", "cy", "w", "h")
            own.setdefault("fl_y", own.get("fl_x"))
            named = isinstance(own["depth_file_path"], str)
            if any(own.get(name) is None for name in (*names, "transform_matrix")) or not named:
                raise checks.InputError(f"{file}: a frame needs depth_file_path, transform_matrix, {', '.join(names)}")
            if bent := [f"{name} {own[name]}" for name in _LENS if own.get(name) and own[name] not in _STRAIGHT]:
                raise checks.InputError(f"{file}: {', '.join(bent)}: lenses that bend are not read; undistort it")
            fx, fy, cx, cy, w, h = (float(checks.require_numbers(f"{file}: {n}", own[n], ())) for n in names)
            if not min(step, fx, fy, w, h) > 0:
                raise checks.InputError(f"{file}: {key}, fl_x, fl_y, w, h must be above 0; got {step, fx, fy, w, h}")
            pose = checks.require_numbers(f"{file}: transform_matrix", own["transform_matrix"], (4, 4)) @ _OPENGL
            yield _Frame(path / own["depth_file_path"], step, _matrix(fx, fy, cx, cy), pose, (w, h))


def _tum(path: Path, intrinsics: Float[np.ndarray, "3 3"]) -> Iterator[_Frame]:
    truth, images = path / "groundtruth.txt", _lines(path / "depth.txt")
    lines = _lines(truth)
    poses = _table(truth, lines, 8)
    wrong = [line for line, row in zip(lines, poses, strict=True) if not (np.isfinite(row).all() and row[4:].any())]
    if wrong or not lines:
        raise checks.InputError(f"{truth}: holds no pose{f' in the line {wrong[0]!r}' if wrong else ''}")
    times = poses[:, 0]
    for line in images:
        when, _, name = line.partition(" ")
        time = float(_table(path / "depth.txt", [when], 1)[0, 0])
        nearest = int(np.abs(times - time).argmin())
        if abs(times[nearest] - time) <= _APART:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = transforms.rotation_of(poses[nearest, 4:]), poses[nearest, 1:4]
            yield _Frame(path / name.strip(), _TUM_STEP, intrinsics, pose)


def _redwood(path: Path, log: Path, intrinsics: Float[np.ndarray, "3 3"]) -> Iterator[_Frame]:
    images, lines = sorted((path / "depth").glob("*.png")), _lines(log)
    if len(lines) % 5:
        raise checks.InputError(f"{log}: a trajectory has five lines a pose; got {len(lines)}")
    for first in range(0, len(lines), 5):
        number = float(_table(log, lines[first : first + 1], None)[0, 0])
        if not 0 <= number < len(images):
            raise checks.InputError(f"{log}: has a pose of image {number:g}; depth/ has {len(images)}")
        yield _Frame(images[int(number)], _MILLIMETRES, intrinsics, _table(log, lines[first + 1 : first + 5], 4))


def _lines(file: Path) -> list[str]:
    """Those that say something."""
    if not file.is_file():
        raise checks.InputError(f"{file}: is not there")
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


def _table(file: Path, lines: list[str], columns: int | None) -> Float[np.ndarray, "n c"]:
    """The numbers of lines, so many in each."""
    try:
        found = np.array([line.split() for line in lines], dtype=np.float64)
        return found if columns is None else found.reshape(len(lines), columns)
    except ValueError as error:
        raise checks.InputError(f"{file}: must have {columns or 'some'} numbers a line ({error})") from error


def _intrinsics(path: Path) -> tuple[Float[np.ndarray, "3 3"], str]:
    """Of a folder whose layout has none of its own, and whose they are."""
    for file in sorted(path.glob("*.json")):
        said = storage.read_json(file)
        if isinstance(said, dict) and "intrinsic_matrix" in said:
            by_columns = checks.require_numbers(f"{file}: intrinsic_matrix", said["intrinsic_matrix"], (9,))
            matrix = by_columns.reshape(3, 3).T
            matrix[:2, 2] += 0.5
            return matrix, file.name
    known = {name: own for name, own in _TUM.items() if name in path.resolve().name}
    (whose, found), *_ = [*known.items(), (_GUESS, _PRIMESENSE)]
    return _matrix(*found[:2], found[2] + 0.5, found[3] + 0.5), whose


def _matrix(fx: float, fy: float, cx: float, cy: float) -> Float[np.ndarray, "3 3"]:
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


_Cloud = tuple[np.ndarray, np.ndarray | None, np.ndarray]  # points, normals, and the sensor where there are none


def _bin(path: Path) -> _Cloud:
    data = path.read_bytes()
    if len(data) % 16:
        raise checks.InputError(f"{path}: {len(data)} bytes are no rows of four float32, as KITTI's scans are")
    return np.frombuffer(data, "<f4").reshape(-1, 4)[:, :3].astype(np.float64), None, np.zeros(3)


def _pcd(path: Path) -> _Cloud:
    from ddf.core import extras

    with path.open("rb") as file:
        head = file.read(4096)
    with extras.named():
        import open3d as o3d

    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        cloud = o3d.io.read_point_cloud(str(path), format="pcd")
    view = re.search(rb"^VIEWPOINT[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", head, re.MULTILINE)
    sensor = np.array([float(each) for each in view.groups()]) if view else np.zeros(3)
    return np.asarray(cloud.points), np.asarray(cloud.normals) if cloud.has_normals() else None, sensor


def _las(path: Path) -> _Cloud:
    """By laspy; what a damaged header claims of the blocks behind it, which laspy reads one by one, is judged first."""
    from ddf.core import extras

    with extras.named():
        import laspy
    with path.open("rb") as file:
        head = file.read(_LAS_HEAD).ljust(_LAS_HEAD, b"\0")
    claimed = 54 * struct.unpack_from("<I", head, 100)[0] + 60 * struct.unpack_from("<I", head, 243)[0] * (head[25] > 3)
    try:
        if claimed > path.stat().st_size:
            raise ValueError("its header claims more than it holds")
        with laspy.open(path) as file:
            if file.header.are_points_compressed:
                raise ValueError("LAZ is not read; write it as LAS")
            found, count = file.read(), file.header.point_count
        points, names = np.array(found.xyz), list(found.point_format.extra_dimension_names)
        if len(points) != count:
            raise ValueError(f"{len(points)} of its {count} points are there")
        if not set(_LAS_NORMALS) <= set(names):
            raise ValueError(f"it needs {', '.join(_LAS_NORMALS)}, as PDAL's filters.normal writes them")
        return points, np.stack([found[name] for name in _LAS_NORMALS], -1).astype(np.float64), np.zeros(3)
    except (laspy.LaspyException, ValueError, OverflowError, MemoryError) as error:
        raise checks.InputError(f"{path}: is not read as LAS: {error or 'too large'}") from error


_CLOUDS: dict[str, Callable[[Path], _Cloud]] = {
    ".bin": _bin,
    ".las": _las,
    ".laz": _las,
    ".pcd": _pcd,
    ".ply": lambda path: (*mesh_io.read_oriented(path), np.zeros(3)),
}

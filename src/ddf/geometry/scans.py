"""What a depth camera or a lidar saw: rays with ranges, from NPZ files of three kinds and from depth images as PNG.

Rays: `positions`, `directions` (N, 3) and `ranges` (N), inf where nothing was met. A depth image: `depth` (H, W) along
the optical axis, inf where nothing is there, with `intrinsics` (3, 3) and, if wanted, `camera_to_scan` (4, 4), `width`
and `height` of the image that the intrinsics are of; the camera looks along Z, X to the right, Y down. Points: `points`
(N, 3) and `sensors`, (3,) or (N, 3), from where each was seen. All in one frame and unit, that of the scan; in rows, or
as an image. What is no range, in any of them, is told by `_returned` and left out.

A PNG of 16 bits of grey is such a depth; a JSON object beside it, of the same name, has what goes with it, and
`depth_scale`, the unit of the scan in a step of grey: 0.001 if not said, millimetres to metres. A PNG of `ddf render`
says its step itself, and its depths are along the rays.
"""

import functools
import io
import math
import warnings
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from jaxtyping import Bool, Float, Int, Num

from ddf.core import checks, errors, storage
from ddf.geometry import rays, transforms

_BROKEN = (OSError, ValueError, SyntaxError, EOFError, MemoryError)  # what Pillow raises of a damaged PNG
_RAYS, _DEPTH, _POINTS = ("positions", "directions", "ranges"), ("depth", "intrinsics"), ("points", "sensors")
_OF_CAMERA = ("camera_to_scan", "width", "height")  # what a depth image may have besides
_STEP = "depth_step"  # of a PNG that `ddf render` wrote
_NARROWEST, _WIDEST = 0.01, 20.0  # tangents: of half a view under .6 or over 87 degrees the intrinsics are wrong
_OFF_CENTRE = 0.1  # of the image, from its middle to the principal point, at most where the image's size is not told
_MILLIMETRES, _MOST_STEP = 0.001, 100.0  # of grey; TUM's and Open3D's 5000 and 1000 are the inverse
_ABSENT, _ENDLESS = 65535.0, 1e10  # what sensors of 16 bits, and renderers, write where there is no range
_FAR, _MANY = 1.5, 0.05  # times the second largest range, share of hits: a largest range that may mean none
_MOST_PIXELS, _MOST_RAYS = 50_000_000, 2_000_000
_RIGID = 1e-5  # by how much the scale of a camera may differ from 1: float32 files are within 1e-6


@dataclass(frozen=True)
class Scan:
    """Rays and how far each went before it met something: `inf` where it met nothing.

    remarks: what of a file is left out or doubtful, one line each. of_camera: whether the frame is that of the camera
    that took it, X right, Y down, Z ahead. InputError where shapes differ, a value is no number, a direction is not of
    unit length, a range is not above 0.
    """

    positions: Float[np.ndarray, "_ 3"]
    directions: Float[np.ndarray, "_ 3"]
    ranges: Float[np.ndarray, "_"]
    remarks: tuple[str, ...] = field(default=(), kw_only=True, compare=False)
    of_camera: bool = field(default=False, kw_only=True, compare=False)

    def __post_init__(self) -> None:
        asked = rays.unit_points(*(np.asarray(each, dtype=np.float64) for each in (self.positions, self.directions)))
        ranges = np.asarray(self.ranges, dtype=np.float64)
        if asked.positions.ndim != 2 or ranges.shape != asked.positions.shape[:1]:
            raise checks.InputError(f"ranges must be one a ray, {asked.positions.shape[:-1]}; got {ranges.shape}")
        wrong = np.flatnonzero(~(ranges > 0))
        if len(wrong):
            raise checks.InputError(
                f"ranges must be above 0, and inf where nothing was met; got {ranges[wrong[0]]} at ray {wrong[0]}"
            )
        for name, value in (("positions", asked.positions), ("directions", asked.directions), ("ranges", ranges)):
            object.__setattr__(self, name, value)

    @property
    def hit(self) -> Bool[np.ndarray, "n"]:
        """Which rays met something."""
        return np.isfinite(self.ranges)

    @property
    def points(self) -> Float[np.ndarray, "m 3"]:
        """Where they met it."""
        return rays.surface_points(self.positions[self.hit], self.directions[self.hit], self.ranges[self.hit])

    def some(self, kept: Bool[np.ndarray, "n"]) -> "Scan":
        """The scan of some of its rays, without remarks."""
        return Scan(self.positions[kept], self.directions[kept], self.ranges[kept], of_camera=self.of_camera)


def of_rays(
    positions: Float[np.ndarray, "*_ 3"], directions: Float[np.ndarray, "*_ 3"], ranges: Float[np.ndarray, "*_"]
) -> Scan:
    """The scan of rays, in rows or as an image; those without a range are left out. InputError where shapes do not fit,
    or what counts is no ray.
    """
    if not positions.shape == directions.shape == (*ranges.shape, 3):
        given = ", ".join(str(each.shape) for each in (positions, directions, ranges))
        raise checks.InputError(f"positions and directions must be (N, 3), ranges one a ray, (N); got {given}")
    kept, remarks = _returned(ranges, "ranges")
    return Scan(positions[kept], directions[kept], ranges[kept], remarks=remarks)


def of_depth(
    depth: Num[np.ndarray, "*_"],
    intrinsics: npt.ArrayLike,
    camera_to_scan: Any = None,
    width: Any = None,
    height: Any = None,
    *,
    scale: float = 1.0,
    along_rays: bool = False,
) -> Scan:
    """The scan of a depth image; see the module. Pixels without a depth are left out, of very many some whole rows and
    columns.

    Args:
      width, height: of the image that the intrinsics are of. scale: of the depths, to the unit of the scan.
      along_rays: whether depths are those along the pixels' rays, as in files of ours, where no value means none.
    """
    if depth.ndim != 2:
        raise checks.InputError(f"depth must be (H, W); got shape {depth.shape}")
    told = [None if each is None else checks.require_numbers("width, height", each, ()) for each in (height, width)]
    wrong = [f"{own:g}" for own, side in zip(told, depth.shape, strict=True) if own is not None and own != side]
    if wrong:
        raise checks.InputError(
            f"intrinsics are of an image of another width or height ({', '.join(wrong)}) than {depth.shape[1]} x "
            f"{depth.shape[0]}; scale them as the image was scaled"
        )
    place = transforms.Similarity.of_matrix("camera_to_scan", np.eye(4) if camera_to_scan is None else camera_to_scan)
    if abs(place.scale - 1) > _RIGID:
        raise checks.InputError(f"camera_to_scan must turn and move, without a scale; got {place.scale:g}")
    kept, remarks = _returned(depth, "depth", np.nan if along_rays else _ABSENT)
    every = math.ceil(math.sqrt(kept.sum() / _MOST_RAYS))
    if every > 1:
        remarks += (f"{kept.sum():,} depths: of every {every} rows and columns one is read",)
        thinned = np.zeros_like(kept)
        thinned[::every, ::every] = kept[::every, ::every]
        kept = thinned
    height, width = depth.shape
    along = pixel_directions(height, width, intrinsics, None not in told, np.flatnonzero(kept))
    ranges = scale * depth[kept].astype(np.float64) / (1.0 if along_rays else along[:, 2])
    starts = np.broadcast_to(place.translation, along.shape)
    turned = place.apply_directions(along)
    return Scan(starts, turned, ranges, remarks=remarks, of_camera=camera_to_scan is None)


def pixel_directions(
    height: int,
    width: int,
    intrinsics: npt.ArrayLike,
    of_this_size: bool = True,
    pixels: Int[np.ndarray, "n"] | None = None,
) -> Float[np.ndarray, "n 3"]:
    """Unit directions through the pixels' centres, row by row, in the frame of the camera.

    Args:
      of_this_size: whether it is told that the intrinsics are of such an image; else the principal point must lie near
        its middle. pixels: those wanted, as indices of the image in rows; None for all.
    """
    matrix = np.asarray(intrinsics, dtype=np.float64)
    whole = matrix.shape == (3, 3) and np.isfinite(matrix).all()
    if not whole or min(matrix[0, 0], matrix[1, 1]) <= 0 or matrix[[1, 2, 2, 2], [0, 0, 1, 2]].tolist() != [0, 0, 0, 1]:
        turned = whole and not matrix[:2, 2].any() and matrix[2, :2].any()
        raise checks.InputError(
            "intrinsics must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with fx, fy above 0, in pixels; "
            f"{'these stand transposed' if turned else f'got {matrix.tolist()}'}"
        )
    inverse, sides, centre = np.linalg.inv(matrix), np.array([width, height]), matrix[:2, 2]
    corners = np.array([(x, y, 1.0) for x in (0.5, width - 0.5) for y in (0.5, height - 0.5)]) @ inverse.T
    near = of_this_size or (np.abs(centre / sides - 0.5) <= _OFF_CENTRE).all()
    if not near or not _NARROWEST <= np.abs(corners[:, :2]).max() <= _WIDEST:
        raise checks.InputError(
            f"intrinsics (f {matrix[0, 0]:g}, centre {centre[0]:g}, {centre[1]:g}) are of another image than {width} x "
            f"{height}; scale them as the image was scaled"
            + ("" if near else "; of an image that was cropped tell width and height too")
        )
    pixels = np.arange(width * height) if pixels is None else pixels
    along = np.ones((len(pixels), 3))
    along[:, 1], along[:, 0] = np.divmod(pixels, width)
    along[:, :2] += 0.5
    along = along @ inverse.T
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    return along


def of_points(points: Float[np.ndarray, "*_"], sensors: Float[np.ndarray, "*_"]) -> Scan:
    """The scan of points, in rows or as an image, and of where each was seen from; those that are none are left out:
    not finite, at the sensor, several at 0.
    """
    checks.require_vectors("points", points)
    checks.require_vectors("sensors", sensors)
    if sensors.size != 3 and sensors.shape != points.shape:
        raise checks.InputError(f"sensors must be (3,) or one a point; got {sensors.shape} for {points.shape}")
    points = points.reshape(-1, 3)
    sensors = np.broadcast_to(sensors.reshape(-1, 3), points.shape)
    checks.require_finite("sensors", sensors[np.isfinite(points).all(axis=-1)])
    with np.errstate(invalid="ignore", over="ignore"):
        way = points - sensors
        ranges = np.linalg.norm(way, axis=-1)
    ranges[~np.isfinite(ranges)] = np.nan
    unset = ~points.any(axis=-1)
    if unset.sum() > 1:
        ranges[unset] = 0.0
    kept, remarks = _returned(ranges, "ranges")
    return Scan(sensors[kept], way[kept] / ranges[kept, None], ranges[kept], remarks=remarks)


def _returned(
    ranges: Num[np.ndarray, "*n"], name: str, absent: float = _ABSENT
) -> tuple[Bool[np.ndarray, "*n"], tuple[str, ...]]:
    """Which are ranges, `inf` among them, and in words which are none: not a number, 0, the largest of 16 bits, 1e10
    or more, or a single number below 0; InputError of several such.
    """
    below = (ranges < 0) & (ranges > -np.inf)
    least = float(ranges.min(where=below, initial=0.0))
    if (ranges[below] != least).any():
        first = tuple(int(i) for i in np.argwhere(below)[0])
        raise checks.InputError(
            f"{name} must be above 0, ahead of the sensor; got {ranges[first]:.6g} at {first}, {below.sum():,} such "
            "values; where there is none write 0"
        )
    none = (
        (f"{least:g}", below),
        ("nan", np.isnan(ranges) | (ranges == -np.inf)),
        ("0", ranges == 0),
        (f"{absent:g}", ranges == absent),
        ("1e10 or more", (ranges >= _ENDLESS) & (ranges < np.inf)),
    )
    kept = ~functools.reduce(np.logical_or, (which for _, which in none))
    words = ", ".join(f"{which.sum():,} are {value}" for value, which in none if which.any())
    remarks = (f"of {ranges.size:,} ranges {words}: no return, left out",) if words else ()
    hit = kept & (ranges < np.inf)
    top = ranges.max(where=hit, initial=0.0)
    lower = hit & (ranges < top)
    many = 1 - lower.sum() / max(1, hit.sum())
    if _MANY <= many < 1 and top > _FAR * ranges.max(where=lower, initial=0.0):
        remarks += (f"{many:.0%} of the hits have the largest range, {top:.6g}: if it means none, write 0",)
    return kept, remarks


_MAKE = {_RAYS: of_rays, _DEPTH: of_depth, _POINTS: of_points}


def read(path: Path) -> Scan:
    """The scan of a file of any of the kinds."""
    if path.suffix.lower() == ".png":
        return _of_png(path)
    if path.suffix.lower() != ".npz" and path.is_file() and not zipfile.is_zipfile(path):
        raise checks.InputError(
            f"{path}: {path.suffix or 'no suffix'} is not read as a scan; make an NPZ of points and sensors, or a depth"
            " PNG (docs/complete.md)"
        )
    found = rays.npz_numbers(path, (*_RAYS, *_DEPTH, *_OF_CAMERA, *_POINTS), alone=True)
    kinds = [kind for kind in _MAKE if set(kind) & set(found)]
    if len(kinds) != 1 or not set(kinds[0]) <= set(found):
        wanted = "; or ".join(" and ".join(names) for names in _MAKE)
        raise checks.InputError(f"{path}: a scan has one of {wanted}; got {', '.join(found) or 'none of them'}")
    (kind,) = kinds
    errors.require_known(f"{path}: {kind[0]}", found, kind + _OF_CAMERA if kind == _DEPTH else kind)
    try:
        return _MAKE[kind](**found)
    except checks.InputError as error:
        raise checks.InputError(f"{path}: {error}") from error


def _of_png(path: Path) -> Scan:
    """Of a depth image and the JSON beside it."""
    (steps, own), about = grey(path), path.with_suffix(".json")
    if not about.exists():
        raise checks.InputError(f"{path}: needs {about.name} beside it, with the camera's intrinsics")
    said = storage.read_json(about)
    if not isinstance(said, dict) or "intrinsics" not in said:
        wanted = "intrinsics (3, 3), perhaps camera_to_scan (4, 4), depth_scale, width and height"
        raise checks.InputError(f"{about}: must be a JSON object with {wanted}")
    errors.require_known(str(about), said, ("intrinsics", "depth_scale", *_OF_CAMERA))
    try:
        scale = float(checks.require_numbers("depth_scale", said.pop("depth_scale", own or _MILLIMETRES), ()))
        if not 0 < scale <= (own or 0) + _MOST_STEP:
            raise checks.InputError(
                f"depth_scale, the unit in a step of grey, must be above 0, {_MOST_STEP:g} at most; got {scale:g}"
                + (f": perhaps its inverse, {1 / scale:g}, is meant" if scale > 0 else "")
            )
        if own and not math.isclose(scale, own, rel_tol=1e-6):
            raise checks.InputError(f"depth_scale is {scale:g}, but {path.name} says {_STEP} {own:g}; leave it out")
        said["intrinsics"] = checks.require_numbers("intrinsics", said["intrinsics"], (3, 3))
        return of_depth(steps, **said, scale=scale, along_rays=own is not None)
    except checks.InputError as error:
        raise checks.InputError(f"{about}: {error}") from error


def grey(path: Path) -> tuple[Num[np.ndarray, "h w"], float | None]:
    """The steps of a PNG of 16 bits, and the size of one, where the file says it."""
    from PIL import Image  # not where scans of NPZ files are read

    checks.require_content(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is judged here
            with Image.open(path, formats=["PNG"]) as image:
                if not image.mode.startswith("I") or image.width * image.height > _MOST_PIXELS:
                    raise checks.InputError(
                        f"{path}: {image.width} x {image.height} pixels of mode {image.mode}; a depth image has 16 bits"
                        f" of grey, and {_MOST_PIXELS} pixels at most"
                    )
                steps, said = np.asarray(image), image.info.get(_STEP)
        own = None if said is None else float(said)
    except checks.InputError:
        raise
    except (Image.DecompressionBombError, *_BROKEN) as error:
        raise checks.InputError(f"{path}: not a readable PNG ({error}); depth images are read as PNG or NPZ") from error
    if own is not None and not 0 < own < np.inf:
        raise checks.InputError(f"{path}: its {_STEP} must be above 0; got {own}")
    return steps, own


def write(scan: Scan, path: Path) -> None:
    """Its rays, as `read` reads them."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, positions=scan.positions, directions=scan.directions, ranges=scan.ranges)
    storage.write_bytes(path, buffer.getvalue())

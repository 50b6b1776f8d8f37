"""What a depth camera or a lidar saw: rays with ranges, from NPZ files of three kinds and from depth images as PNG.

Rays: `positions`, `directions` (N, 3) and `ranges` (N), inf where nothing was met. A depth image: `depth` (H, W) along
the optical axis, 0 where the camera gave nothing, inf where nothing is there, with `intrinsics` (3, 3) and, if wanted,
`camera_to_scan` (4, 4); the camera looks along Z, X to the right, Y down. Points: `points` (N, 3) and `sensors`, (3,)
or (N, 3), from where each was seen. All in one frame and unit, that of the scan.

A PNG of 16 bits of grey is such a depth; a JSON object beside it, of the same name, has `intrinsics`, if wanted
`camera_to_scan`, and `depth_scale`, the unit of the scan in a step of grey: 0.001 if not said, millimetres to metres.
"""

import io
import json
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from jaxtyping import Bool, Float

from ddf.core import checks, storage
from ddf.geometry import rays, transforms

_BROKEN = (OSError, ValueError, SyntaxError, EOFError, MemoryError)  # what Pillow raises of a damaged PNG
_KINDS = (("positions", "directions", "ranges"), ("depth", "intrinsics"), ("points", "sensors"))
_NARROWEST, _WIDEST = 0.01, 20.0  # tangents: of half a view under .6 or over 87 degrees the intrinsics are wrong
_MILLIMETRES = 0.001
_MOST_PIXELS = 50_000_000
_RIGID = 1e-5  # by how much the scale of a camera may differ from 1: float32 files are within 1e-6


@dataclass(frozen=True)
class Scan:
    """Rays and how far each went before it met something: `inf` where it met nothing.

    Raises:
      InputError: shapes differ, a value is no number, a direction is not of unit length, a range is not above 0.
    """

    positions: Float[np.ndarray, "_ 3"]
    directions: Float[np.ndarray, "_ 3"]
    ranges: Float[np.ndarray, "_"]

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


def of_depth(
    depth: Float[np.ndarray, "h w"],
    intrinsics: Float[np.ndarray, "3 3"],
    camera_to_scan: Float[np.ndarray, "4 4"] | None = None,
) -> Scan:
    """The scan of a depth image; see the module. Pixels of depth 0 say nothing and are left out.

    Raises:
      InputError: the depth or the intrinsics are none, or are not of one image.
    """
    depth = np.asarray(depth, dtype=np.float64)
    if depth.ndim != 2 or np.isnan(depth).any() or (depth < 0).any():
        raise checks.InputError(f"depth must be (H, W), 0 or more, without NaN; got shape {depth.shape}")
    place = transforms.Similarity.of_matrix("camera_to_scan", np.eye(4) if camera_to_scan is None else camera_to_scan)
    if abs(place.scale - 1) > _RIGID:
        raise checks.InputError(f"camera_to_scan must turn and move, without a scale; got {place.scale:g}")
    along = pixel_directions(depth.shape[0], depth.shape[1], intrinsics)[depth.ravel() > 0]
    ranges = depth[depth > 0] / along[:, 2]
    return Scan(np.broadcast_to(place.translation, along.shape), place.apply_directions(along), ranges)


def pixel_directions(height: int, width: int, intrinsics: npt.ArrayLike) -> Float[np.ndarray, "n 3"]:
    """Unit directions through the pixels' centres, row by row, in the frame of the camera.

    Raises:
      InputError: the intrinsics are none, or are not of such an image.
    """
    matrix = np.asarray(intrinsics, dtype=np.float64)
    if matrix.shape != (3, 3) or not np.isfinite(matrix).all() or min(matrix[0, 0], matrix[1, 1]) <= 0:
        raise checks.InputError(
            "intrinsics must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with fx, fy above 0, in pixels"
        )
    rows, columns = np.indices((height, width)).reshape(2, -1)
    pixels = np.stack((columns + 0.5, rows + 0.5, np.ones(len(rows))), axis=-1)
    along = pixels @ np.linalg.inv(matrix).T
    inside = 0 <= matrix[0, 2] <= width and 0 <= matrix[1, 2] <= height
    if not inside or not _NARROWEST <= np.abs(along[:, :2]).max() <= _WIDEST:
        raise checks.InputError(
            f"intrinsics (f {matrix[0, 0]:g}, centre {matrix[0, 2]:g}, {matrix[1, 2]:g}) are of another image "
            f"than {width} x {height}; scale them as the image was scaled"
        )
    return along / np.linalg.norm(along, axis=-1, keepdims=True)


def of_points(points: Float[np.ndarray, "n 3"], sensors: Float[np.ndarray, "*n 3"]) -> Scan:
    """The scan of points and of where each was seen from.

    Raises:
      InputError: the shapes do not fit, or a point lies in its sensor.
    """
    checks.require_vectors("points", points)
    checks.require_vectors("sensors", sensors)
    sensors = np.broadcast_to(np.asarray(sensors, dtype=np.float64), points.shape) if sensors.ndim == 1 else sensors
    if sensors.shape != points.shape:
        raise checks.InputError(f"sensors must be (3,) or one a point; got {sensors.shape} for {points.shape}")
    way = points - sensors
    ranges = np.linalg.norm(way, axis=-1)
    if not (ranges > 0).all():
        raise checks.InputError(f"a point must lie away from its sensor; got one at it, index {int(ranges.argmin())}")
    return Scan(sensors, way / ranges[:, None], ranges)


def read(path: Path) -> Scan:
    """The scan of a file of any of the kinds.

    Raises:
      FileNotFoundError: there is no such file. InputError: it holds none; it is named.
    """
    if path.suffix.lower() == ".png":
        return _of_png(path)
    found = rays.npz_numbers(path, (*_KINDS[0], *_KINDS[1], "camera_to_scan", *_KINDS[2]))
    kind = next((kind for kind in _KINDS if set(kind) <= set(found)), None)
    if kind is None:
        wanted = "; or ".join(" and ".join(names) for names in _KINDS)
        raise checks.InputError(f"{path}: a scan has {wanted}; got {', '.join(found) or 'none of them'}")
    make = {_KINDS[0]: Scan, _KINDS[1]: of_depth, _KINDS[2]: of_points}[kind]
    extra = {"camera_to_scan"} & set(found) if kind is _KINDS[1] else ()
    try:
        return make(*(found[name] for name in (*kind, *extra)))
    except checks.InputError as error:
        raise checks.InputError(f"{path}: {error}") from error


def _of_png(path: Path) -> Scan:
    """Of a depth image and the JSON beside it."""
    steps, about = _grey(path), path.with_suffix(".json")
    try:
        said = json.loads(about.read_text(encoding="utf-8"))
        place, scale = said.get("camera_to_scan"), float(said.get("depth_scale", _MILLIMETRES))
        intrinsics = np.array(said["intrinsics"], dtype=np.float64)
        place = None if place is None else np.array(place, dtype=np.float64)
    except FileNotFoundError as error:
        raise checks.InputError(f"{path}: needs {about.name} beside it, with the camera's intrinsics") from error
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        wanted = "intrinsics (3, 3), perhaps camera_to_scan (4, 4) and depth_scale"
        raise checks.InputError(f"{about}: must be a JSON object with {wanted} ({error})") from error
    if not 0 < scale < np.inf:
        raise checks.InputError(f"{about}: depth_scale, the unit in a step of grey, must be above 0; got {scale}")
    try:
        return of_depth(steps * scale, intrinsics, place)
    except checks.InputError as error:
        raise checks.InputError(f"{about}: {error}") from error


def _grey(path: Path) -> Float[np.ndarray, "h w"]:
    """The steps of a PNG of 16 bits."""
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
                return np.asarray(image, dtype=np.float64)
    except checks.InputError:
        raise
    except (Image.DecompressionBombError, *_BROKEN) as error:
        raise checks.InputError(f"{path}: not a readable PNG ({error}); depth images are read as PNG or NPZ") from error


def write(scan: Scan, path: Path) -> None:
    """Its rays, as `read` reads them."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, positions=scan.positions, directions=scan.directions, ranges=scan.ranges)
    storage.write_bytes(path, buffer.getvalue())

"""Cameras that are told, not predicted: how the framed object is seen, or a pinhole camera and where it stands.

The picture of a pinhole camera is turned into what the models' lens takes from its place when it looks at the object.
Both have one centre, so that is exact whatever the lens, the roll and the object's place in the picture (Hartley and
Zisserman 2004, §8.4). Telephoto lenses alone, farther away than training cameras, are taken for nearer ones.

World of a matrix: the frame v1, X ahead, Y up, box centred at 0, diagonal 1; Z up instead in `transforms.json`; or what
`object_to_world` moves v1 to. Camera axes: X right, Y up, Z backwards (OpenGL's).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch.nn import functional

from ddf.core import checks, errors, storage
from ddf.geometry import cameras, transforms

SIDE, _EACH = 274, 3  # pixels a side of a picture that is turned; looks at the picture along a side of each
_FARTHEST, _EXACT = 1.25, 1e-3  # of the farthest training camera: what is farther is magnified; of R^T R
_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # v1 to the world of transforms.json
_MATRICES, _FRAMED = ("camera_to_world", "transform_matrix"), ("azimuth_deg", "elevation_deg", "radius")
_LENGTHS, _BENT = ("fl_x", "fl_y", "cx", "cy", "h"), ("k1", "k2", "p1", "p2")  # pixels; without unit
_MODELS = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "RADIAL", "SIMPLE_RADIAL")  # of lenses that these describe


@dataclass(frozen=True)
class Pinhole:
    """A camera of a whole picture; pose: of v1, its scale aside.

    lens: f_x, f_y and the principal point from the left and the top (None: the middle), in widths of the picture. bent:
    k_1, k_2, p_1, p_2 of OpenCV's lens. ratio: height over width; None for the picture's own. where: for complaints.
    """

    pose: transforms.Similarity
    lens: tuple[float, float, float | None, float | None]
    bent: tuple[float, ...]
    ratio: float | None
    where: str

    def framed(
        self, pixels: UInt8[np.ndarray, "h w 4"], farthest: float
    ) -> tuple[UInt8[np.ndarray, "s s 4"], Float[np.ndarray, "3"]]:
        """The picture as the models' lens has it, and its azimuth, elevation (radians) and radius (benchmark units);
        training cameras are at most `farthest` away. InputError where the picture is of another shape, or does not show
        the place of the object.
        """
        ratio = pixels.shape[0] / pixels.shape[1]
        if self.ratio and abs(self.ratio - ratio) > 0.02 * ratio:
            raise checks.InputError(f"{self.where}: w and h are not of the picture's shape, {pixels.shape[1::-1]}")
        centre, rotation = self.pose.translation, self.pose.rotation
        seen = self._place(-centre @ rotation, ratio)
        radius = float(np.linalg.norm(centre)) * transforms.BENCHMARK_FROM_V1
        if not (np.abs(seen) <= 1).all() or radius <= transforms.BENCHMARK_FROM_V1 / 2:
            raise checks.InputError(f"{self.where}: does not look at the object, whose box has diagonal 1 about 0")
        x, y, z = centre
        found = np.array([np.arctan2(z, x), np.arctan2(y, np.hypot(x, z)), min(radius, _FARTHEST * farthest)])
        ways = cameras.pixel_directions(_EACH * SIDE, np.zeros(1)) * [found[2] / radius, found[2] / radius, 1.0]
        places = self._place(ways @ cameras.rotation(*found[:2]) @ rotation, ratio)
        weighed = torch.from_numpy(pixels).permute(2, 0, 1)[None].float()
        weighed[:, :3] *= weighed[:, 3:] / 255
        looks = functional.grid_sample(weighed, torch.from_numpy(places)[None].float(), align_corners=False)
        means = functional.avg_pool2d(looks, _EACH)
        means[:, :3] *= 255 / means[:, 3:].clamp_min(1)
        turned = means[0].permute(1, 2, 0).round().clamp(0, 255).to(torch.uint8).numpy()
        if not (turned[..., 3] >= 128).any():
            raise checks.InputError(f"{self.where}: the picture shows nothing where the object stands")
        return turned, found

    def _place(self, ways: Float[np.ndarray, "*b 3"], ratio: float) -> Float[np.ndarray, "*b 2"]:
        """Where directions, camera frame, are seen: -1 to 1 across the picture and down; outside where it does not."""
        ahead = -ways[..., 2]
        x, y = (ways[..., axis] / np.where(ahead > 0, ahead, np.inf) for axis in (0, 1))
        y, (k1, k2, p1, p2) = -y, self.bent
        square = np.minimum(x * x + y * y, 1.0)
        radial = 1 + k1 * square + k2 * square**2
        bent_x = x * radial + 2 * p1 * x * y + p2 * (square + 2 * x * x)
        bent_y = y * radial + p1 * (square + 2 * y * y) + 2 * p2 * x * y
        f_x, f_y, c_x, c_y = self.lens
        across, down = (c_x or 0.5) + f_x * bent_x, ((c_y or ratio / 2) + f_y * bent_y) / ratio
        return np.where(ahead[..., None] > 0, 2 * np.stack((across, down), axis=-1) - 1, 2.0)


# Of the framed object: azimuth, elevation (radians), radius (benchmark units).
Camera = Float[np.ndarray, "3"] | Pinhole


def read(given: str | Path | Sequence[Any] | Mapping[str, Any], images: Sequence[Path]) -> list[Camera]:
    """A camera of each picture, from a JSON file or its content, as docs/formats.md has it; a list of (azimuth,
    elevation, radius) in degrees and benchmark units will do.
    """
    file, content, shared = Path("cameras"), given, {}
    if isinstance(given, str | Path):
        file, content = Path(given), storage.read_json(given)
    if isinstance(content, Mapping) and isinstance(content.get("frames"), list):
        shared = {"object_to_world": _Z_UP, **content}
        frames = [frame for frame in content["frames"] if isinstance(frame, Mapping)]
        content = {str(frame.get("file_path")): frame for frame in frames}
        if len(content) < len(frames):
            raise checks.InputError(f"{file}: two frames have the same file_path, or none; each picture has one")
    if isinstance(content, Mapping) and "camera" not in content:
        content = [content[_named(image, content, file)] for image in images]
    content = content.get("cameras", content) if isinstance(content, Mapping) else content
    entries = list(content) if isinstance(content, list | tuple | np.ndarray) else [content]
    if len(entries) != len(images):
        raise checks.InputError(f"{file}: each picture needs a camera: {len(images)} pictures, {len(entries)} cameras")
    pairs = zip(entries, images, strict=True)
    return [_camera(entry, shared, f"{file}: the camera of {image.name}") for entry, image in pairs]


def _named(image: Path, names: Iterable[str], file: Path) -> str:
    """The name that is a picture's, with its suffix or without; of several such, the path that leads to it."""
    same = [name for name in names if Path(name).name in (image.name, image.stem)]
    if len(same) > 1:
        own = image.resolve()
        same = [name for name in same if (file.parent / name).resolve() in (own, own.with_suffix(""))]
    if len(same) != 1:
        there = errors.known_names(image.name, [Path(name).name for name in names])
        raise checks.InputError(f"{file}: needs one camera of {image.name}; there are {there}")
    return same[0]


def _camera(entry: Any, shared: Mapping[str, Any], where: str) -> Camera:
    """One camera, in the units of the models."""
    entry = entry.get("camera", entry) if isinstance(entry, Mapping) else entry
    said = {**shared, **entry} if isinstance(entry, Mapping) else {}
    key = next((name for name in _MATRICES if name in said), None)
    if key is None:
        numbers = [said.get(name) for name in _FRAMED] if said else entry
        told = f"{where}: is azimuth, elevation (degrees) and radius > 0, or has a matrix"
        return cameras.degrees_to_radians(_numbers(numbers, (3,), told, [-np.inf, -np.inf, 0]))
    if said.get("camera_model", "OPENCV") not in _MODELS:
        raise checks.InputError(f"{where}: camera_model {said['camera_model']} is not read; turn it into a pinhole's")
    if any(said.get(name) for name in ("k3", "k4", "k5", "k6")):
        raise checks.InputError(f"{where}: a lens of more than k1, k2, p1, p2 is not read; undistort the picture")
    pose = transforms.Similarity.of_matrix(f"{where}: {key}", said[key], _EXACT)
    if abs(pose.scale - 1) > _EXACT:
        raise checks.InputError(f"{where}: {key} must turn and move alone; it scales by {pose.scale:.3g}")
    world = said.get("object_to_world", np.eye(4))
    pose = transforms.Similarity.of_matrix(f"{where}: object_to_world", world, _EXACT).inverse().compose(pose)

    def length(name: str, least: float = 0.0) -> float:
        return float(_numbers(said.get(name), (), f"{where}: {name} of its lens is a number > {least:g}", least))

    bent = tuple(length(name, -np.inf) if name in said else 0.0 for name in _BENT)
    if "fl_x" not in said:
        angle = length("camera_angle_x")
        if not angle < np.pi:
            raise checks.InputError(f"{where}: camera_angle_x of its lens is in radians, below pi; got {angle:g}")
        focal = 0.5 / np.tan(angle / 2)
        if not {"w", "cx", "cy"} & said.keys():
            return Pinhole(pose, (focal, focal, None, None), bent, None, where)
        said["fl_x"] = focal * length("w")
    width = length("w")
    f_x, f_y, c_x, c_y, height = (length(name) / width if name in said else None for name in _LENGTHS)
    assert f_x is not None
    return Pinhole(pose, (f_x, f_y or f_x, c_x, c_y), bent, height, where)


def _numbers(value: Any, shape: tuple[int, ...], told: str, least: Any) -> Float[np.ndarray, "..."]:
    """Finite numbers above the least, or the complaint."""
    try:
        found = checks.require_numbers(told, value, shape)
    except checks.InputError:
        found = None
    if found is None or not (found > least).all():
        raise checks.InputError(f"{told}; got {value}")
    return found

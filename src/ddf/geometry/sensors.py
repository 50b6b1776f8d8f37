"""Depth cameras and lidars: which rays they send, and what is wrong with what they measure."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry import cameras, scans, transforms

CAMERA = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])  # columns: X right, Y down, Z ahead, of right, up and back
LIDAR = np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]])  # columns: X ahead, Y left, Z up
_HALF_VIEW_DEG = 25.0
_AZIMUTH_DEG, _ELEVATION_DEG = 35.0, 15.0
_AWAY = 1.05  # half diagonals of a box over the sine of half the view, from which it is seen whole


@dataclass(frozen=True)
class Sweep(scans.Scan):
    """A scan with the angle between each ray and the normal where it ends, degrees; NaN where it met nothing."""

    incidence_deg: Float[np.ndarray, "n"]

    @property
    def intensity(self) -> Float[np.ndarray, "n"]:
        """What a matt surface sends back: the cosine of the incidence, 0 where nothing was met."""
        return np.nan_to_num(np.cos(np.radians(self.incidence_deg)))

    def save(self, path: str | Path) -> None:
        """An NPZ file that `scans.read` reads."""
        scans.write(self, Path(path))


def measured(
    positions: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "n 3"],
    depth: Float[np.ndarray, "n"],
    normals: Float[np.ndarray, "n 3"],
    *,
    noise: float = 0.0,
    outliers: float = 0.0,
    reach: float = math.inf,
    seed: int = 0,
) -> Sweep:
    """What a sensor makes of the true depths; a range that noise would make nothing or less is a miss.

    Args:
      noise: deviation of a range. outliers: share of hits with any range up to twice the true one. reach: longest.
    """
    if not (0 <= noise < math.inf and 0 <= outliers <= 1 and reach > 0):
        raise checks.InputError(
            f"noise must be 0 or more, outliers a share, reach above 0; got {noise}, {outliers}, {reach}"
        )
    rng = np.random.default_rng(seed)
    ranges = depth + noise * rng.normal(size=len(depth))
    stray = rng.random(len(depth)) < outliers
    ranges = np.where(stray, 2 * depth * rng.random(len(depth)), ranges)
    ranges = np.where((ranges > 0) & (ranges <= reach), ranges, np.inf)
    cosine = np.clip(-(normals * directions).sum(axis=-1), -1.0, 1.0)
    incidence = np.where(np.isfinite(ranges), np.degrees(np.arccos(cosine)), np.nan)
    return Sweep(positions, directions, ranges, incidence)


def fan(
    beams: int, columns: int, elevation_deg: tuple[float, ...], azimuth_deg: tuple[float, ...]
) -> Float[np.ndarray, "n 3"]:
    """Directions of a spinning lidar, column by column; of a whole turn the last column is not the first again."""
    spans = (elevation_deg, azimuth_deg)
    if any(len(span) != 2 or not np.isfinite(span).all() for span in spans) or np.abs(elevation_deg).max() > 90:
        raise checks.InputError(f"elevation and azimuth must be two angles each, in degrees; got {spans}")
    up = np.radians(np.linspace(elevation_deg[0], elevation_deg[1], beams))
    turns = np.radians(
        np.linspace(azimuth_deg[0], azimuth_deg[1], columns, endpoint=abs(azimuth_deg[1] - azimuth_deg[0]) < 360)
    )
    turn, up = (each.ravel() for each in np.meshgrid(turns, up, indexing="ij"))
    return np.stack((np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)), axis=-1)


def default_intrinsics(height: int, width: int) -> Float[np.ndarray, "3 3"]:
    """A field of view of 50 degrees along the shorter side."""
    focal = min(height, width) / 2 / math.tan(math.radians(_HALF_VIEW_DEG))
    return np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1.0]])


def facing(
    lower: Float[np.ndarray, "3"], upper: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]
) -> transforms.Similarity:
    """A sensor's pose from which a box is seen whole: from the front, the right and above, of a scene with Y up;
    axes of the sensor as columns of (right, up, back), `CAMERA` or `LIDAR`.
    """
    frame = cameras.rotation(*np.radians([_AZIMUTH_DEG, _ELEVATION_DEG])).T
    away = _AWAY * float(np.linalg.norm(upper - lower)) / 2 / math.sin(math.radians(_HALF_VIEW_DEG))
    return transforms.Similarity(1.0, frame @ axes, (lower + upper) / 2 + away * frame[:, 2])

"""Depth cameras and lidars that look at a field, a scene or a mesh: scans to test other code with, or `complete`."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from ddf.api import meshes, queries
from ddf.core import checks
from ddf.geometry import scans, sensors


def depth_camera(
    scene: Any,
    poses: npt.ArrayLike | None = None,
    *,
    size: int | Sequence[int] = 64,
    intrinsics: npt.ArrayLike | None = None,
    noise: float = 0.0,
    outliers: float = 0.0,
    reach: float = math.inf,
    seed: int = 0,
) -> sensors.Sweep:
    """What a depth camera measures, one ray a pixel, row by row.

    Args:
      scene: a field, a `Scene`, or a mesh as of `cast`.
      poses: (4, 4) or (k, 4, 4), camera to scene: it looks along its Z, X to the right, Y down. None: one from
        which a field of view of 50 degrees holds the whole box of the scene.
      size: pixels, (height, width) or both. intrinsics: (3, 3) in pixels, None for a field of view of 50 degrees.
      noise: standard deviation of a range, unit of the scene. outliers: share of hits whose range is any up to twice
        the true one. reach: larger ranges are misses. seed: of both.
    Returns:
      `positions`, `directions` (n, 3), `ranges` (n), `inf` where nothing is met, for all poses in order;
      `incidence_deg` (n), angle between the ray and the normal, NaN where nothing is met; `intensity` (n), its cosine,
      0 there; `save(path)` writes what `ddf complete` reads.
    Raises:
      ValueError: a wrong shape, intrinsics of another image, noise or outliers out of range.

    Example:
      >>> import ddf
      >>> scan = ddf.depth_camera(ddf.load("rabbit"), size=32)
      >>> scan.ranges.shape, bool(0.05 < scan.hit.mean() < 0.9)
      ((1024,), True)
    """
    sides = (size, size) if isinstance(size, int | np.integer) else size
    height, width = (checks.require_whole("size", side, 1) for side in sides)
    directions = scans.pixel_directions(
        height, width, sensors.default_intrinsics(height, width) if intrinsics is None else intrinsics
    )
    faults = {"noise": noise, "outliers": outliers, "reach": reach, "seed": seed}
    return _measured(scene, directions, poses, sensors.CAMERA, faults)


def lidar(
    scene: Any,
    poses: npt.ArrayLike | None = None,
    *,
    beams: int = 16,
    columns: int = 360,
    elevation_deg: Sequence[float] = (-15.0, 15.0),
    azimuth_deg: Sequence[float] = (-180.0, 180.0),
    noise: float = 0.0,
    outliers: float = 0.0,
    reach: float = math.inf,
    seed: int = 0,
) -> sensors.Sweep:
    """What a spinning lidar measures, column by column.

    Args:
      poses: as of `depth_camera`; the lidar's X is ahead, Y to the left, Z up.
      beams, elevation_deg: rays of a column, evenly between two elevations. columns, azimuth_deg: of a turn to the
        left.
      The rest is as of `depth_camera`.

    Example:
      >>> import ddf
      >>> sweep = ddf.lidar(ddf.load("rabbit"), beams=8, columns=90)
      >>> sweep.ranges.shape, bool(sweep.hit.any())
      ((720,), True)
    """
    checks.require_whole("beams", beams, 1)
    checks.require_whole("columns", columns, 1)
    directions = sensors.fan(beams, columns, tuple(elevation_deg), tuple(azimuth_deg))
    faults = {"noise": noise, "outliers": outliers, "reach": reach, "seed": seed}
    return _measured(scene, directions, poses, sensors.LIDAR, faults)


def _measured(
    scene: Any,
    directions: Float[np.ndarray, "m 3"],
    poses: npt.ArrayLike | None,
    axes: Float[np.ndarray, "3 3"],
    faults: dict[str, Any],
) -> sensors.Sweep:
    """Along all directions from all poses."""
    if poses is None:
        lower, upper = scene.box if isinstance(scene, queries.Queried) else meshes.as_mesh(scene).box()
        places = [sensors.facing(lower, upper, axes)]
    else:
        places = queries.require_poses("a pose", poses)
    starts = np.repeat([place.translation for place in places], len(directions), axis=0)
    ways = np.concatenate([place.apply_directions(directions) for place in places])
    if isinstance(scene, queries.Queried):
        found = scene.query(starts, ways, ("depth", "normals"))
        depth, normals = found["depth"], found["normals"]
    else:
        hits = meshes.cast(scene, starts, ways)
        depth, normals = hits.depth, hits.normals
    return sensors.measured(starts, ways, depth, normals, **faults)

"""Rays a second of `ddf.depth_camera` and `ddf.lidar`, normals and all, beside Open3D's bare cast of the mesh.

Cameras of 64 x 64 pixels and lidars of 16 beams and 256 columns stand around a shape, one or 64 in a call. `network` is
the field that comes with the package, `patches` what `ddf fit` makes, `ddf mesh` the same door to the mesh itself.
Errors are against that one: the median of the depth in percent of half the longest side; `wrong` are percents of rays
whose hit is, or whose depth is off by more than 2 % of that. Times are processor time.
"""

import functools
import itertools
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import ddf
from bench.data import ray_casting
from bench.fields import fits
from bench.lib import measuring
from ddf.api.field import Field
from ddf.data.synthetic import showcase
from ddf.fields.grid import octree
from ddf.fit import inspection
from ddf.geometry import cameras, mesh_io, raycast, rays, sensors, transforms

SHAPES, POSES, REPEATS = ("armchair", "rabbit"), (1, 64), 5
SENSORS: dict[str, Callable[..., sensors.Sweep]] = {
    "camera": ddf.depth_camera,
    "lidar": functools.partial(ddf.lidar, columns=256, elevation_deg=(-25.0, 25.0), azimuth_deg=(-25.0, 25.0)),
}
AXES = {"camera": sensors.CAMERA, "lidar": sensors.LIDAR}


def around(mesh: mesh_io.Mesh, axes: np.ndarray, count: int) -> np.ndarray:
    """Poses of sensors that see all of the mesh's box, in a ring about its vertical axis."""
    first = sensors.facing(*mesh.box(), axes)
    middle = np.mean(mesh.box(), axis=0)
    turns = cameras.rotation(2 * np.pi * np.arange(count) / count, np.zeros(count)).transpose(0, 2, 1)
    moved = [transforms.Similarity(1.0, turn, middle - turn @ middle) for turn in turns]
    return np.stack([turn.compose(first).to_matrix() for turn in moved])


def main() -> measuring.Rows:
    """Every shape, sensor, number of poses and way."""
    fits.compile_patches()
    for name in SHAPES:
        mesh = showcase.SHAPES[name]()
        scene, patches = raycast.Scene(mesh), fits.patches(mesh, octree.PatchConfig().tolerance)[1]
        scenes = {"ddf mesh": mesh, "patches": Field(patches), "network": ddf.load(f"{name}-network")}
        for (sensor, look), count in itertools.product(SENSORS.items(), POSES):
            poses = around(mesh, AXES[sensor], count)
            truth = look(mesh, poses)
            local = ray_casting.local_rays(scene, rays.OrientedPoints(truth.positions, truth.directions))
            ways: dict[str, Callable[[], Any]] = {"Open3D": functools.partial(ray_casting.Open3D(scene), local)}
            ways |= {way: functools.partial(look, asked, poses) for way, asked in scenes.items()}
            for way, seconds in measuring.interleaved(ways, REPEATS, clock=time.process_time).items():
                depth = ways[way]()[0] * scene.scale if way == "Open3D" else ways[way]().ranges
                both = np.isfinite(depth) & truth.hit
                off = np.abs(depth[both] - truth.ranges[both]) / scene.scale
                error = {
                    "depth_median_percent": 100 * float(np.median(off)),
                    "wrong_percent": 100 * float(inspection.wrong(depth, truth.ranges, fits.OFF * scene.scale).mean()),
                }
                size = {"shape": name, "sensor": sensor, "poses": count, "rays": len(depth)}
                row = measuring.row(way, size, seconds, error)
                yield {**row, "million_rays_per_s": len(depth) / row["median_s"] / 1e6}

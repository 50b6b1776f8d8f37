"""Rivals of a DDF: signed distances on a grid, and sphere tracing through them; how rivals are trained.

Letters: f signed distance (negative inside), p + t v the ray. Source: Hart 1996, "Sphere tracing".

On the grid f is trilinear between samples. A ray steps by |f|, at least by a part of a voxel, until f changes its sign,
and the secant says where, so that what starts on either side of a wall is told apart.
"""

import contextlib
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from jaxtyping import Float
from torch import nn

from ddf.geometry import raycast, rays
from ddf.geometry.grid_loops import compiled
from ddf.models import loop_config
from ddf.training import training_loop

Network = TypeVar("Network", bound=nn.Module)


def trained(
    network: Network,
    loss: training_loop.StepLoss,
    steps: int,
    loop: loop_config.LoopConfig,
    describe: str,
    kept: Path | None = None,
) -> Network:
    """`network` after so many steps, in evaluation mode.

    Args:
      kept: folder of this very training, from whose last checkpoint it goes on.
    """
    groups = [{"params": list(network.parameters()), "weight_decay": 0.0}]
    with contextlib.nullcontext(kept) if kept else tempfile.TemporaryDirectory() as folder:
        training_loop.fit(network, groups, loss, steps, loop, Path(folder), {"fingerprint": ""}, describe)
    return network.eval()


def signed_distances(scene: raycast.Scene, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """f of a closed mesh, in its unit: Open3D's nearest triangle, its distance in float64, sign by parity."""
    return scene.distance(points) * np.where(scene.outside(points), 1.0, -1.0)


LEAST, MOST_STEPS = 0.25, 1024  # of a voxel, a step; steps of a ray
ON, OFF = 0.1, 0.5  # voxels: a start that is so near to a wall lies on it; how far it goes unseen
_MARGIN, _NEAR = 2, 2  # voxels around the mesh; within which a distance is exact


@dataclass(frozen=True)
class DistanceGrid:
    """Samples in the mesh's unit, float32, at lower + voxel (i, j, k)."""

    samples: Float[np.ndarray, "a b c"]
    lower: Float[np.ndarray, "3"]
    voxel: float

    def cast(self, points: rays.OrientedPoints) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
        """Depth, `inf` on a miss, and normals that face back."""
        starts = np.ascontiguousarray((points.positions - self.lower) / self.voxel)
        found = _traced(self.samples, starts, np.ascontiguousarray(points.directions), self.voxel)
        return found[:, 0], found[:, 1:]


def on_grid(scene: raycast.Scene, side: int) -> DistanceGrid:
    """So many voxels along the longest side of a closed mesh, a multiple of 8; the others as its box asks.

    Coarse samples first; where one shows that the surface is further than `_NEAR`, its bound is kept.
    """
    lower, upper = scene.mesh.box()
    voxel = float((upper - lower).max()) / (side - 2 * _MARGIN)
    size = 8 * np.ceil(((upper - lower) / voxel + 2 * _MARGIN) / 8 - 1e-9).astype(int)
    lower, samples = (lower + upper - size * voxel) / 2, np.zeros((0, 0, 0))
    for step in (8, 4, 2, 1):
        index = np.indices(tuple(size // step + 1))
        if step == 8:
            samples, near = np.zeros(index.shape[1:]), np.ones(index.shape[1:], bool)
        else:
            samples = samples[tuple((index + 1) // 2)]
            away = step * voxel * np.sqrt((index % 2).sum(axis=0))
            samples = np.copysign(np.maximum(np.abs(samples) - away, 0), samples)
            near = np.abs(samples) < _NEAR * step * voxel
        samples[near] = signed_distances(scene, index[:, near].T * (step * voxel) + lower)
    return DistanceGrid(samples.astype(np.float32), lower, voxel)


@compiled
def _sample(samples, x, y, z):
    """f and its gradient a voxel, at a place in voxels; that of the nearest cell outside."""
    i = min(max(int(x), 0), samples.shape[0] - 2)
    j = min(max(int(y), 0), samples.shape[1] - 2)
    k = min(max(int(z), 0), samples.shape[2] - 2)
    x, y, z = x - i, y - j, z - k
    a, b, c, d = samples[i, j, k], samples[i, j, k + 1], samples[i, j + 1, k], samples[i, j + 1, k + 1]
    e, f, g, h = samples[i + 1, j, k], samples[i + 1, j, k + 1], samples[i + 1, j + 1, k], samples[i + 1, j + 1, k + 1]
    ab, cd, ef, gh = a + z * (b - a), c + z * (d - c), e + z * (f - e), g + z * (h - g)
    low, high = ab + y * (cd - ab), ef + y * (gh - ef)
    along_y = (1 - x) * (cd - ab) + x * (gh - ef)
    along_z = (1 - x) * ((1 - y) * (b - a) + y * (d - c)) + x * ((1 - y) * (f - e) + y * (h - g))
    return low + x * (high - low), high - low, along_y, along_z


@compiled
def _traced(samples, starts, directions, voxel):
    """(n, 4): depth and normal of rays whose starts are in voxels."""
    out = np.zeros((len(starts), 4))
    for ray in range(len(starts)):
        px, py, pz = starts[ray, 0], starts[ray, 1], starts[ray, 2]
        vx, vy, vz = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        t, leave = 0.0, np.inf
        for axis in range(3):
            p, v, end = starts[ray, axis], directions[ray, axis], samples.shape[axis] - 1.0
            if v != 0:
                t, leave = max(t, min(-p / v, (end - p) / v)), min(leave, max(-p / v, (end - p) / v))
            elif p < 0 or p > end:
                leave = -np.inf
        out[ray, 0] = np.inf
        if t > leave:
            continue
        f = _sample(samples, px + t * vx, py + t * vy, pz + t * vz)[0]
        if abs(f) < ON * voxel:  # starts on a wall, and leaves it
            t += OFF
            f = _sample(samples, px + t * vx, py + t * vy, pz + t * vz)[0]
        for _ in range(MOST_STEPS):
            step = max(abs(f) / voxel, LEAST)
            t += step
            if t > leave:
                break
            after = _sample(samples, px + t * vx, py + t * vy, pz + t * vz)[0]
            if (after < 0) != (f < 0):
                t -= step * after / (after - f)
                _, nx, ny, nz = _sample(samples, px + t * vx, py + t * vy, pz + t * vz)
                length = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
                length = -length if nx * vx + ny * vy + nz * vz > 0 else length
                out[ray, 0], out[ray, 1], out[ray, 2], out[ray, 3] = t * voxel, nx / length, ny / length, nz / length
                break
            f = after
    return out

"""Ray casting: this package and Open3D by rational numbers: rays a second beside leaks and depth error.

Three questions to one closed mesh of 10,000 triangles: random rays inside its box, rays of a camera, and from its
centre rays through vertices and middles of edges, where a caster can leak. A leak is a miss where the reference hits;
rational numbers answer a thousand rays.
"""

import functools
from collections.abc import Callable

import numpy as np
import open3d as o3d
import torch

from bench.lib import exact_cast, measuring
from ddf.geometry import raycast, rays
from ddf.geometry.mesh_io import Mesh

FACES, MANY, TRUTHS, REPEATS, THREADS = 10_000, 200_000, 1000, 5, 2

Depths = np.ndarray


def sphere(faces: int) -> Mesh:
    """A closed unit sphere of about so many triangles: rings of a grid, welded at seam and poles."""
    rings = max(round(np.sqrt(faces / 4)), 2)
    height, turn = np.pi * np.arange(1, rings) / rings, 2 * np.pi * np.arange(2 * rings) / (2 * rings)
    height, turn = (grid.ravel() for grid in np.meshgrid(height, turn, indexing="ij"))
    middle = np.stack([np.sin(height) * np.cos(turn), np.cos(height), np.sin(height) * np.sin(turn)], axis=1)
    index = np.arange(len(middle)).reshape(rings - 1, 2 * rings)
    a, b = index[:-1], index[1:]
    c, d = np.roll(a, -1, axis=1), np.roll(b, -1, axis=1)
    north, south = np.full(2 * rings, len(middle)), np.full(2 * rings, len(middle) + 1)
    quads = [np.stack([x.ravel() for x in corners], axis=1) for corners in ((a, c, b), (c, d, b))]
    caps = [
        np.stack([north, np.roll(index[0], -1), index[0]], axis=1),
        np.stack([south, index[-1], np.roll(index[-1], -1)], axis=1),
    ]
    return Mesh(np.concatenate([middle, [[0, 1.0, 0], [0, -1.0, 0]]]), np.concatenate([*quads, *caps]))


def random_rays(count: int) -> rays.OrientedPoints:
    """Positions uniform in the cube, directions on the sphere."""
    generator = torch.Generator().manual_seed(0)
    directions = torch.randn((count, 3), generator=generator, dtype=torch.float64)
    positions = 2 * torch.rand((count, 3), generator=generator, dtype=torch.float64) - 1
    return rays.OrientedPoints(positions, torch.nn.functional.normalize(directions, dim=-1))


def camera_rays(count: int) -> rays.OrientedPoints:
    """From one point at distance 3 to a square across the origin."""
    side = int(np.sqrt(count))
    across = np.stack(np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side)), axis=-1).reshape(-1, 2)
    targets = torch.from_numpy(np.concatenate([across, np.zeros((len(across), 1))], axis=1))
    start = torch.tensor([0.3, 0.4, 3.0], dtype=torch.float64).expand_as(targets)
    return rays.OrientedPoints(start, torch.nn.functional.normalize(targets - start, dim=-1))


def edge_rays(mesh: Mesh, count: int) -> rays.OrientedPoints:
    """From the centre through vertices and middles of edges, over and over, in mixed order."""
    corners = mesh.triangles
    places = np.concatenate([mesh.vertices, (0.5 * (corners + np.roll(corners, 1, axis=1))).reshape(-1, 3)])
    places = np.random.default_rng(0).permutation(places)
    targets = torch.from_numpy(np.resize(places, (count, 3)))
    return rays.OrientedPoints(torch.zeros_like(targets), torch.nn.functional.normalize(targets, dim=-1))


class Open3D:
    """Open3D's float32 answers as they come: rays (n, 6) in `raycast.Scene.local`, as depth and normal."""

    def __init__(self, scene: raycast.Scene) -> None:
        self._scene, self._tensor = o3d.t.geometry.RaycastingScene(), o3d.core.Tensor
        corners = scene.local(scene.mesh.vertices).astype(np.float32), scene.mesh.faces[scene.kept].astype(np.uint32)
        self._scene.add_triangles(*map(self._tensor, corners))

    def __call__(self, local: np.ndarray) -> tuple[Depths, np.ndarray]:
        """Depth and normal."""
        answer = self._scene.cast_rays(self._tensor.from_numpy(local))
        return answer["t_hit"].numpy(), answer["primitive_normals"].numpy()


def local_rays(scene: raycast.Scene, points: rays.OrientedPoints) -> np.ndarray:
    """What `Open3D` is asked."""
    positions, directions = raycast.flat(points.positions), raycast.flat(points.directions)
    return np.concatenate([scene.local(positions), directions], axis=1).astype(np.float32)


def compared(found: Depths, truth: Depths) -> dict[str, float]:
    """Leaks, hits of nothing and depth errors against the reference."""
    hit, there = np.isfinite(found), np.isfinite(truth)
    error = np.abs(found[hit & there] - truth[hit & there])
    return {
        "leaks": float((there & ~hit).sum()),
        "false_hits": float((hit & ~there).sum()),
        "depth_max": float(error.max(initial=0.0)),
        "depth_median": float(np.median(error)) if len(error) else 0.0,
        "compared_rays": float(len(truth)),
    }


def main() -> measuring.Rows:
    """Both casters, by question."""
    mesh = sphere(FACES)
    scene = raycast.Scene(mesh)
    own = Open3D(scene)
    casters: dict[str, Callable[[rays.OrientedPoints], Depths]] = {
        "Open3D": lambda points: own(local_rays(scene, points))[0] * scene.scale,
        "ddf.geometry.raycast.cast": lambda points: raycast.cast(scene, points).depth.numpy(),
    }
    questions = {"random": random_rays(MANY), "camera": camera_rays(MANY), "edges": edge_rays(mesh, MANY)}
    for name, points in questions.items():
        step = len(points.positions) // TRUTHS
        probes = rays.OrientedPoints(points.positions[::step], points.directions[::step])
        truth = exact_cast.cast(mesh, probes).depth.numpy()
        ways = {caster: functools.partial(cast, points) for caster, cast in casters.items()}
        for caster, seconds in measuring.interleaved(ways, REPEATS).items():
            size = {"rays": name, "triangles": len(mesh.faces), "count": len(points.positions)}
            row = measuring.row(caster, size, seconds, compared(casters[caster](probes), truth))
            yield {**row, "million_rays_per_s": len(points.positions) / row["median_s"] / 1e6}

"""Meshes to measure on: procedural chairs, planes and cars, and real ones where they lie beside the project."""

from pathlib import Path

import numpy as np

from bench.lib import measuring
from ddf.data.synthetic import assemble, cars, chairs, planes
from ddf.geometry import mesh_io

REAL = measuring.REAL_MESHES
_BUILD = {"chair": chairs.build, "plane": planes.build, "car": cars.build}


def procedural(kind: str, seed: int) -> mesh_io.Mesh:
    """One shape as the stage `dataset` designs it, faults of collected models included."""
    rng = np.random.default_rng(seed)
    shape = assemble.shape(_BUILD[kind](rng), rng)
    return mesh_io.Mesh(shape.vertices, shape.triangles)


def sphere(faces: int) -> mesh_io.Mesh:
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
    return mesh_io.Mesh(np.concatenate([middle, [[0, 1.0, 0], [0, -1.0, 0]]]), np.concatenate([*quads, *caps]))


def real(names: tuple[str, ...]) -> dict[str, mesh_io.Mesh]:
    """Those of the named files that are there."""
    return {Path(name).stem: mesh_io.load(REAL / name) for name in names if (REAL / name).is_file()}

"""Ground-truth point clouds: Poisson-disk samples of the raw mesh, hidden inner faces included.

As the official clouds of Pixel2Mesh: drawn on all faces, about 8,000 points, none closer than a radius to another.
`hidden` marks points that no ray from outside meets first. Own dart throwing: it is seeded by a numpy generator
(Open3D's and MeshLab's are seeded globally), and as fast as Open3D's sample elimination (0.1 s).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import spatial

from ddf import meshes, raycast
from ddf.mesh_io import Mesh, face_normals

_CANDIDATES = 6  # per point wanted: enough darts for a set that is nearly maximal
_DENSITY = 0.6  # points a maximal set holds, times radius squared, by area; measured on planes, thin parts hold fewer
_TOLERANCE = 0.1  # of the count wanted; official clouds have 7 to 9 thousand points
_MAX_ROUNDS = 8


@dataclass(frozen=True)
class Cloud:
    """Points on a surface, in the mesh's frame, and whether each is hidden from outside."""

    points: Float[np.ndarray, "n 3"]
    hidden: Bool[np.ndarray, "n"]


def draw(mesh: Mesh, count: int, rng: np.random.Generator) -> Cloud:
    """A Poisson-disk cloud of `count` points within 10 % and the visibility of each (64 rays, see `raycast`)."""
    points, face = poisson_disk(mesh, count, rng)
    hidden = ~raycast.visible_from_outside(raycast.Scene(mesh), points, face)
    return Cloud(points.astype(np.float32), hidden)


def poisson_disk(
    mesh: Mesh, count: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "n"]]:
    """Points of which no two are closer than a radius, chosen so that the count is met within 10 %, and their
    triangles.

    The darts are drawn once; the radius is corrected until the count fits (distances are between points in space, so
    sheets closer than the radius share their points).

    Raises:
      InputError: no triangle has an area.
    """
    darts, face = meshes.sample_surface(mesh, _CANDIDATES * count, rng)
    tree = spatial.cKDTree(darts)
    radius = np.sqrt(_DENSITY * face_normals(mesh)[1].sum() / count)
    kept = _throw(tree, radius)
    for _ in range(_MAX_ROUNDS - 1):
        if abs(len(kept) - count) <= _TOLERANCE * count:
            break
        radius *= np.sqrt(len(kept) / count)
        kept = _throw(tree, radius)
    return darts[kept], face[kept]


def _throw(tree: spatial.cKDTree, radius: float) -> Int[np.ndarray, "k"]:
    """Indices of the darts that stay when they are thrown in order and each must keep `radius` from those before it.

    In rounds over all pairs at once: a dart that no undecided earlier one is near stays, its later neighbours go.
    """
    pairs = tree.query_pairs(radius, output_type="ndarray")
    early, late = pairs.min(axis=1), pairs.max(axis=1)
    undecided, stays = np.ones(tree.n, dtype=bool), np.zeros(tree.n, dtype=bool)
    while undecided.any():
        live = undecided[early] & undecided[late]
        early, late = early[live], late[live]
        waits = np.zeros(tree.n, dtype=bool)
        waits[late] = True
        accepted = undecided & ~waits
        stays |= accepted
        undecided &= waits
        undecided[late[accepted[early]]] = False
    return np.flatnonzero(stays)

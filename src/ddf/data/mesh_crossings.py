"""Where a mesh passes through itself: edges that pierce triangles by more than a tolerance.

Two surfaces that cross have an edge of one through the inside of a triangle of the other. Only a crossing deeper than
the tolerance counts, on both sides of the triangle and from its border, so that the answer is the same at any scale
and place and after any rounding far below the tolerance; contact is no crossing. Open3D proposes (in float32), float64
decides.
"""

import numpy as np
from jaxtyping import Float, Int

from ddf.geometry import raycast
from ddf.geometry.mesh_io import Mesh

TOLERANCE = 1e-5  # of the diagonal: the noise of float32 far from the origin; ten times less than any real detail
_BLOCK = 1 << 16  # edges at once: each meets a few triangles along its line


def pierced(mesh: Mesh, tolerance: float = TOLERANCE) -> Int[np.ndarray, "k 2"]:
    """Edges (by their vertices) that pierce a triangle, as pairs of vertices, one row per piercing.

    Args:
      mesh: of which every triangle has an area.
      tolerance: share of the diagonal.
    """
    scene = raycast.Scene(mesh)
    edges = np.unique(np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    local, least = scene.local(mesh.vertices), tolerance * mesh.diagonal() / scene.scale
    found = [
        block[_deep(local, mesh.faces, block, *scene.met_along(local[block[:, 0]], local[block[:, 1]]), least)]
        for block in np.split(edges, range(_BLOCK, len(edges), _BLOCK))
    ]
    return np.concatenate(found)


def _deep(
    vertices: Float[np.ndarray, "n 3"],
    faces: Int[np.ndarray, "m 3"],
    edges: Int[np.ndarray, "e 2"],
    edge: Int[np.ndarray, "h"],
    face: Int[np.ndarray, "h"],
    least: float,
) -> Int[np.ndarray, "k"]:
    """Of proposed pairs of an edge and a triangle the edges of those that cross by more than `least`."""
    apart = (faces[face][:, :, None] != edges[edge][:, None, :]).all(axis=(1, 2))
    edge, face = edge[apart], face[apart]
    corners, ends = vertices[faces[face]], vertices[edges[edge]]
    sides = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(sides[:, 0], sides[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    height = np.einsum("hej,hj->he", ends - corners[:, :1], normal)
    through = (height.prod(axis=1) < 0) & (np.abs(height).min(axis=1) > least)
    edge, corners, ends, sides, normal, height = (
        values[through] for values in (edge, corners, ends, sides, normal, height)
    )
    share = height[:, 0] / (height[:, 0] - height[:, 1])
    point = ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0])
    inwards = np.cross(normal[:, None], sides)
    inwards /= np.linalg.norm(sides, axis=2)[..., None]
    within = np.einsum("hij,hij->hi", point[:, None] - corners, inwards).min(axis=1)
    return edge[within > least]

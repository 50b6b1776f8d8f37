"""Polygons cut into triangles: a fan from the first corner where that covers the polygon, else by manifold3d.

A fan covers a polygon when all its triangles turn the same way as the polygon. manifold3d works in the plane of the
polygon's area vector and uses every corner, those on a straight line too, so that neighbours still share their edges.
"""

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks

MAX_CORNERS = 100_000
_FLAT = 1e-9  # of the longest side squared: a smaller triangle of a fan counts as none
_PLANE = 1e-3  # of the longest side: corners further off the plane make a polygon that is not planar
_CHUNK = 1 << 20  # corners at once
_WORK = 5e9  # corners squared, of all concave polygons of a file: about five seconds


def triangulate(
    vertices: Float[np.ndarray, "n 3"], counts: Int[np.ndarray, "p"], corners: Int[np.ndarray, "c"]
) -> tuple[Int[np.ndarray, "m 3"], int]:
    """Triangles of all polygons in their order, `count - 2` each, and how many crossed themselves and were fanned.

    Args:
      counts: corners of each polygon, 3 or more.
      corners: vertices of all polygons, one after the other.
    Raises:
      InputError: a flat polygon of five corners or more that crosses itself or has a hole, or too many corners.
    """
    if len(counts) and counts.max() > MAX_CORNERS:
        raise checks.InputError(f"a polygon has {counts.max()} corners; at most {MAX_CORNERS} are read")
    if (counts == 3).all():
        return corners.reshape(-1, 3), 0
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    place = np.concatenate([[0], np.cumsum(counts - 2)[:-1]])
    faces = np.zeros((int((counts - 2).sum()), 3), dtype=np.int64)
    concave: list[int] = []
    for size in np.unique(counts):
        members, step = np.flatnonzero(counts == size), max(_CHUNK // int(size), 1)
        for block in np.split(members, range(step, len(members), step)):
            own = corners[first[block][:, None] + np.arange(size)]
            fan = np.stack([np.broadcast_to(own[:, :1], own[:, 2:].shape), own[:, 1:-1], own[:, 2:]], axis=2)
            faces[place[block][:, None] + np.arange(size - 2)] = fan
            concave.extend(block[~_is_covered_by_fan(vertices[own])])
    if sum(float(counts[i]) ** 2 for i in concave) > _WORK:
        raise checks.InputError("too many corners in concave polygons; cut them into triangles first")
    crossing = 0
    for i in sorted(concave):
        own = corners[first[i] : first[i] + counts[i]]
        triangles = cut(vertices[own])
        if triangles is not None:
            faces[place[i] : place[i] + counts[i] - 2] = own[triangles]
        elif counts[i] > 4 and _is_flat(vertices[own]):
            raise checks.InputError(
                f"polygon {i + 1} ({counts[i]} corners) crosses itself or has a hole; cut it into triangles first"
            )
        else:
            crossing += 1
    return faces, crossing


def _fan_normals(points: Float[np.ndarray, "*p k 3"]) -> Float[np.ndarray, "*p t 3"]:
    """Twice the area vector of each triangle of the fan from the first corner."""
    spokes = points[..., 1:, :] - points[..., :1, :]
    return np.cross(spokes[..., :-1, :], spokes[..., 1:, :])


def _longest(points: Float[np.ndarray, "*p k 3"]) -> Float[np.ndarray, "*p"]:
    return np.asarray((points.max(axis=-2) - points.min(axis=-2)).max(axis=-1))


def _is_covered_by_fan(points: Float[np.ndarray, "p k 3"]) -> np.ndarray:
    """Whether the fan is right; a polygon without an area has nothing to cover."""
    if points.shape[1] == 3:
        return np.ones(len(points), dtype=bool)
    scale = _longest(points)[:, None, None]
    parts = _fan_normals(points / np.where(scale > 0, scale, 1.0))
    whole = parts.sum(axis=1)
    length = np.linalg.norm(whole, axis=1)
    along = np.einsum("ptk,pk->pt", parts, whole) / np.where(length > 0, length, 1.0)[:, None]
    empty = np.abs(parts).max(axis=(1, 2)) <= _FLAT
    return empty | (along > _FLAT).all(axis=1)


def cut(points: Float[np.ndarray, "k 3"]) -> Int[np.ndarray, "t 3"] | None:
    """Corners of the triangles of one polygon; None if it crosses itself in its plane, or has no area."""
    import manifold3d

    local, whole = _in_unit_box(points)
    area = float(np.linalg.norm(whole))
    if area <= _FLAT:
        return None
    normal = whole / area
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    flat = np.stack([local @ across, local @ np.cross(normal, across)], axis=1, dtype=np.float64)
    triangles = np.asarray(manifold3d.triangulate([flat]), dtype=np.int64).reshape(-1, 3)
    (ux, uy), (vx, vy) = ((flat[triangles[:, j]] - flat[triangles[:, 0]]).T for j in (1, 2))
    covered = np.abs(ux * vy - uy * vx).sum()
    return triangles if len(triangles) == len(points) - 2 and covered <= area * (1 + 1e-6) else None


def _in_unit_box(points: Float[np.ndarray, "k 3"]) -> tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "3"]]:
    """A polygon moved to its first corner and scaled to 1, and twice its area vector."""
    local = (points - points[0]) / (_longest(points) or 1.0)
    return local, _fan_normals(local).sum(axis=0)


def _is_flat(points: Float[np.ndarray, "k 3"]) -> bool:
    local, whole = _in_unit_box(points)
    area = float(np.linalg.norm(whole))
    return float(np.abs(local @ (whole / (area or 1.0))).max()) <= _PLANE

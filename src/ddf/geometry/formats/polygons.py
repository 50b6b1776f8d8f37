"""Polygons cut into triangles: a fan from the first corner where that covers the polygon, else by manifold3d.

A fan covers a polygon when all its triangles turn the same way as the polygon, and less than once around. Of
quadrilaterals one of the two diagonals will do. manifold3d works in the plane of the polygon's area vector and uses
every corner, those on a straight line too, so that neighbours still share their edges.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf.core import checks

MAX_CORNERS = 100_000
_FLAT = 1e-9  # of the longest side squared: a smaller triangle of a fan counts as none
_PLANE = 1e-3  # of the longest side: corners further off the plane make a polygon that is not planar
_CHUNK = 1 << 16  # corners at once
_CALL = 1e5  # corners squared whose time a call of manifold3d takes for itself
_WORK = 4e9  # corners squared, of all other polygons of a file: about five seconds


def triangulate(
    vertices: Float[np.ndarray, "n 3"], counts: Int[np.ndarray, "p"], corners: Int[np.ndarray, "c"], refuse: bool = True
) -> tuple[Int[np.ndarray, "m 3"], int]:
    """Triangles of all polygons in their order, `count - 2` each, and how many crossed themselves and were fanned.

    Args:
      counts: corners of each polygon, 3 or more.
      corners: vertices of all polygons, one after the other.
      refuse: flat polygons that cannot be cut; else they are fanned.
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
    concave: list[np.ndarray] = []
    crossing = 0
    order = np.argsort(counts, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(counts[order])) + 1):
        size = int(counts[members[0]])
        step = max(_CHUNK // size, 1)
        for block in np.split(members, range(step, len(members), step)):
            own = corners[first[block][:, None] + np.arange(size)]
            own, covered = _turned_quads(vertices, own) if size == 4 else (own, _is_covered_by_fan(vertices[own]))
            fan = np.stack([np.broadcast_to(own[:, :1], own[:, 2:].shape), own[:, 1:-1], own[:, 2:]], axis=2)
            faces[place[block][:, None] + np.arange(size - 2)] = fan
            crossing += int((~covered).sum()) if size == 4 else 0
            concave += [block[~covered]] if size > 4 else []
    left = np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *concave]))
    if float((counts[left].astype(float) ** 2 + _CALL).sum()) > _WORK:
        raise checks.InputError("too many corners in concave polygons; cut them into triangles first")
    for i in left.tolist():
        own = corners[first[i] : first[i] + counts[i]]
        triangles = cut(vertices[own])
        if triangles is not None:
            faces[place[i] : place[i] + counts[i] - 2] = own[triangles]
        elif refuse and _is_flat(vertices[own]):
            raise checks.InputError(
                f"polygon {i + 1} ({counts[i]} corners) crosses itself or has a hole; cut it into triangles first"
            )
        else:
            crossing += 1
    return faces, crossing


def _turned_quads(
    vertices: Float[np.ndarray, "n 3"], own: Int[np.ndarray, "p 4"]
) -> tuple[Int[np.ndarray, "p 4"], Bool[np.ndarray, "p"]]:
    """Quadrilaterals turned so that a fan from the first corner covers them, and where one does.

    One of the diagonals is inside. Where none is, they cross themselves. With a repeated corner or three corners on a
    line, a triangle without an area is part of the fan if there is no other way.
    """
    a, b, c, d = (vertices.take(own[:, i], axis=0).T for i in range(4))
    size_sq = np.stack([((p - q) ** 2).sum(axis=0) for p, q in ((a, b), (b, c), (c, d), (d, a), (a, c))]).max(axis=0)
    least = _FLAT * size_sq
    whole = _cross(c - a, d - b)  # twice the area vector
    first = _cross(b - a, c - a)
    length = np.sqrt((whole**2).sum(axis=0))
    along = whole / np.where(length > 0, length, 1.0)
    of_first = (first * along).sum(axis=0)
    of_second = (_cross(c - b, d - b) * along).sum(axis=0)
    empty = (np.abs(first).max(axis=0) <= least) & (np.abs(whole - first).max(axis=0) <= least)
    covers = [np.minimum(part, length - part) for part in (of_first, of_second)]  # the smaller triangle of each fan
    second = (covers[0] <= least) & ((covers[1] > least) | ((covers[0] < -least) & (covers[1] >= -least))) & ~empty
    covered = empty | (np.maximum(*covers) >= -least)
    found = own.copy()
    found[second] = np.roll(own[second], -1, axis=1)
    return found, covered & ((length > 0) | empty)


def _cross(u: Float[np.ndarray, "3 *p"], v: Float[np.ndarray, "3 *p"]) -> Float[np.ndarray, "3 *p"]:
    """u x v; numpy's own takes three times as long."""
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])


def _fan_normals(points: Float[np.ndarray, "*p k 3"]) -> Float[np.ndarray, "*p t 3"]:
    """Twice the area vector of each triangle of the fan from the first corner."""
    spokes = points[..., 1:, :] - points[..., :1, :]
    along = np.moveaxis(spokes, -1, 0)
    return np.moveaxis(_cross(along[..., :-1], along[..., 1:]), 0, -1)


def _longest(points: Float[np.ndarray, "*p k 3"]) -> Float[np.ndarray, "*p"]:
    return np.asarray((points.max(axis=-2) - points.min(axis=-2)).max(axis=-1))


def _is_covered_by_fan(points: Float[np.ndarray, "p k 3"]) -> np.ndarray:
    """Whether the fan of triangles, or of five corners or more, is right; without an area nothing is to cover."""
    if points.shape[1] == 3:
        return np.ones(len(points), dtype=bool)
    scale = _longest(points)[:, None, None]
    parts = _fan_normals(points / np.where(scale > 0, scale, 1.0))
    whole = parts.sum(axis=1)
    length = np.linalg.norm(whole, axis=1)
    along = np.einsum("ptk,pk->pt", parts, whole) / np.where(length > 0, length, 1.0)[:, None]
    empty = np.abs(parts).max(axis=(1, 2)) <= _FLAT
    spokes = (points[:, 1:] - points[:, :1]) / np.where(scale > 0, scale, 1.0)
    turns = np.arctan2(along, np.einsum("ptk,ptk->pt", spokes[:, :-1], spokes[:, 1:]))
    return empty | ((along > _FLAT).all(axis=1) & (turns.sum(axis=1) < 2 * np.pi))


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

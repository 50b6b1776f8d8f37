"""First hits in rational numbers, every ray against every triangle: what casters are judged by."""

from fractions import Fraction

import numpy as np

from ddf.core.arrays import Array
from ddf.geometry import raycast, rays
from ddf.geometry.mesh_io import Mesh

_ROUNDING = 1e-13  # of a product of three lengths, in float64


def cast(mesh: Mesh, points: rays.OrientedPoints[Array]) -> rays.RayHits[Array]:
    """As `raycast.cast`; of triangles that are equally near the first."""
    scene = raycast.Scene(mesh)
    positions, directions = raycast.flat(points.positions), raycast.flat(points.directions)
    depth, face, corners = np.full(len(positions), np.inf), np.full(len(positions), -1), mesh.triangles[scene.kept]
    for i in range(len(positions) if len(corners) else 0):
        a, b, c = np.moveaxis(corners - positions[i], 1, 0)
        sides = np.stack([np.cross(p, q) @ directions[i] for p, q in ((b, c), (c, a), (a, b))])
        slack = _ROUNDING * np.abs(corners - positions[i]).max(axis=(1, 2)) ** 2
        near = np.flatnonzero((sides.min(axis=0) >= -slack) | (sides.max(axis=0) <= slack))
        for k in near:
            t = meet(positions[i].tolist(), directions[i].tolist(), corners[k].tolist())
            if t < depth[i]:
                depth[i], face[i] = t, scene.kept[k]
    return raycast.hits(scene, directions, depth, face, points.positions)


def meet(position: list[float], direction: list[float], triangle: list[list[float]]) -> float:
    """Depth t >= 0 of a ray on a triangle, in lengths of its direction; `inf` where it passes by, lies in the plane, or
    leaves it behind.

    a, b, c: corners seen from the start. v·(b x c) and its two sisters tell the sides, their sum v·n the slope, and
    t = a·(b x c) / v·n.
    """
    start, v = ([Fraction(x) for x in vector] for vector in (position, direction))
    a, b, c = ([Fraction(x) - s for x, s in zip(corner, start, strict=True)] for corner in triangle)
    sides = [_dot(v, _cross(b, c)), _dot(v, _cross(c, a)), _dot(v, _cross(a, b))]
    slope = sum(sides)
    if slope == 0 or (min(sides) < 0 < max(sides)):
        return float("inf")
    depth = _dot(a, _cross(b, c)) / slope
    return float(depth) if depth >= 0 else float("inf")


def _cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))

"""Where one ray meets one triangle, pair by pair: float64, and exact arithmetic where float64 cannot tell.

Source: Woop et al. 2013, "Watertight ray/triangle intersection": sheared edge functions, whose signs agree between the
triangles of an edge; zero counts as inside, so no ray slips between two triangles. Each comes with a bound of its
rounding; a pair whose answer the bound leaves open is computed again in rational numbers (Shewchuk 1997 calls the idea
a filter).
"""

from fractions import Fraction

import numpy as np
from jaxtyping import Float

_EPSILON = float(np.finfo(np.float64).eps)
_ROUNDINGS = 64  # half-steps that an edge function may be off by, in units of its largest product (counted by hand: 40)
_DEPTH = 1e-11  # of the depth: what rounding may cost before rational numbers are asked


def meet(
    positions: Float[np.ndarray, "k 3"], directions: Float[np.ndarray, "k 3"], triangles: Float[np.ndarray, "k 3 3"]
) -> Float[np.ndarray, "k"]:
    """Depth t >= 0 of each ray on its own triangle, in lengths of its direction; `inf` where it passes by, lies in the
    plane, or leaves it behind.
    """
    depth, inside, unsure = _filtered(positions, directions, triangles)
    found = np.where(inside & (depth >= 0), depth, np.inf)
    for i in np.flatnonzero(unsure):
        found[i] = _rational(positions[i].tolist(), directions[i].tolist(), triangles[i].tolist())
    return found


def _filtered(
    positions: Float[np.ndarray, "k 3"], directions: Float[np.ndarray, "k 3"], triangles: Float[np.ndarray, "k 3 3"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth on the plane, whether the ray passes inside, and whether rounding leaves either open."""
    corners = triangles - positions[:, None]
    z = np.argmax(np.abs(directions), axis=1)[:, None]
    dx, dy, dz = (np.take_along_axis(directions, (z + i) % 3, axis=1) for i in (1, 2, 0))
    cx, cy, cz = (np.take_along_axis(corners, ((z + i) % 3)[:, None], axis=2)[..., 0] for i in (1, 2, 0))
    px, py = cx - (dx / dz) * cz, cy - (dy / dz) * cz
    nx, ny = np.roll(px, -1, axis=1), np.roll(py, -1, axis=1)
    edges = np.roll(px * ny - py * nx, -1, axis=1)  # edge function opposite to each corner
    total = edges.sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (edges * cz).sum(axis=1) / total / dz[:, 0]
    largest = np.abs(corners).max(axis=(1, 2))
    slack = _ROUNDINGS * _EPSILON * np.maximum(np.abs(px), np.abs(py)).max(axis=1) * largest
    least, most = edges.min(axis=1), edges.max(axis=1)
    inside = ((least >= 0) | (most <= 0)) & (total != 0)
    beside = (least < -slack) & (most > slack)  # both signs, surely
    spread = cz.max(axis=1) - cz.min(axis=1) + _EPSILON * largest
    with np.errstate(divide="ignore", invalid="ignore"):
        off = slack / np.abs(total) * spread / np.abs(dz[:, 0])
        poor = ~(off <= _DEPTH * np.abs(depth))
    on_edge = np.abs(edges).min(axis=1) <= slack
    return depth, inside, ~beside & (on_edge | (inside & poor))


def _rational(position: list[float], direction: list[float], triangle: list[list[float]]) -> float:
    """`meet` of one pair without rounding, until the depth is made a float.

    a, b, c: corners seen from the start. v·(b x c) and its two sisters tell the sides, their sum v·n the slope, and
    t = a·(b x c) / v·n.
    """
    start, v = ([Fraction(x) for x in vector] for vector in (position, direction))
    a, b, c = ([Fraction(x) - s for x, s in zip(corner, start, strict=True)] for corner in triangle)
    bc = _cross(b, c)
    sides = [_dot(v, bc), _dot(v, _cross(c, a)), _dot(v, _cross(a, b))]
    slope = sum(sides)
    if slope == 0 or (min(sides) < 0 < max(sides)):
        return float("inf")
    depth = _dot(a, bc) / slope
    return float(depth) if depth >= 0 else float("inf")


def _cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))

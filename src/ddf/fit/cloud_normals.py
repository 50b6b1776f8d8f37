"""Normals of points on the surface of a field: what it says where it is asked along rays through each point.

Evenly spread directions are tried, from outside the field's box. The answer whose hit comes nearest to the point gives
the normal, of equal ones that which looks at the surface most squarely (derived here). So the normal faces the side
from which the surface is seen from outside. A point that no such ray reaches, inside a closed shape say, is asked about
from a small distance, and its normal faces the side that this happens to be.
"""

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.fields import framed_field
from ddf.geometry import rays

DIRECTIONS = 32  # asked through a point
NEAR = (
    0.05  # of the longest side of the box: a hit counts that is nearer to the point, and inner points are asked thence
)
SQUARE = 0.25  # how much of that distance a grazing look costs; small: the nearest hit decides


def ask(field: framed_field.FramedField, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Unit normals, mesh frame, of points near the surface; 0 where the field sees nothing there from any side.

    Costs `DIRECTIONS` queries with normals a point, and as many again for those that cannot be seen from outside.
    """
    checks.require_finite("points", points)
    sides = (field.upper - field.lower) / field.field_from_mesh.scale
    near = NEAR * float(sides.max())
    normals = _best(field, points, 2 * float(np.linalg.norm(sides)), near)
    hidden = ~normals.any(axis=1)
    normals[hidden] = _best(field, points[hidden], near, near)
    return normals


def _best(
    field: framed_field.FramedField, points: Float[np.ndarray, "n 3"], offset: float, near: float
) -> Float[np.ndarray, "n 3"]:
    """The best answer of rays that start at `offset` from the points; 0 where none hits within `near` of its point."""
    normals, best = np.zeros_like(points), np.full(len(points), near)
    for direction in rays.evenly_spread(DIRECTIONS):
        along = np.broadcast_to(direction, points.shape).copy()
        asked = rays.OrientedPoints(points - offset * along, along)
        found, _ = framed_field.query(field, asked, ("depth", "normals"))
        squarely = 1 + (found["normals"] * along).sum(axis=1)
        cost = np.abs(found["depth"] - offset) + SQUARE * near * squarely
        better = cost < best
        best[better], normals[better] = cost[better], found["normals"][better]
    return normals

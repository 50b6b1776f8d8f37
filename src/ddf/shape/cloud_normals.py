"""Normals of points on the surface of a field: what it says where it is asked a little away from each point.

Around a point evenly spread directions are tried; the field is asked from a small distance. The answer whose hit comes
nearest to the point gives the normal, of equal ones that which looks at the surface most squarely (derived here). The
normal faces the side from which the surface is seen.
"""

import numpy as np
import torch
from jaxtyping import Float

from ddf.core import checks
from ddf.geometry import rays, sphere
from ddf.shape import shape_field

DIRECTIONS = 32  # asked around a point
OFFSET = 0.05  # of the longest side of the field's box: from where it is asked
SQUARE = 0.25  # how much of the offset a grazing look may cost; small: the nearest hit decides


def ask(shape: shape_field.ShapeField, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Unit normals, mesh frame, of points near the surface; 0 where the field sees nothing from any side.

    Costs `DIRECTIONS` queries with normals a point.
    """
    checks.require_finite("points", points)
    offset = OFFSET * float((shape.upper - shape.lower).max()) / shape.field_from_mesh.scale
    directions = sphere.evenly_spread(DIRECTIONS)
    normals = np.zeros_like(points)
    best = np.full(len(points), np.inf)
    for direction in directions:
        along = np.broadcast_to(direction, points.shape).copy()
        asked = rays.OrientedPoints(torch.from_numpy(points - offset * along), torch.from_numpy(along))
        found, _ = shape_field.query(shape, asked, ("depth", "normals"))
        squarely = 1 + (found["normals"] * along).sum(axis=1)
        cost = np.abs(found["depth"] - offset) + SQUARE * offset * squarely
        better = cost < best
        best[better], normals[better] = cost[better], found["normals"][better]
    return normals

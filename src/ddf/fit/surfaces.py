"""Triangle meshes of a field, three ways, and normals of points on its surface.

`poisson`: screened Poisson through hits with the field's normals. Smooth, and closed but where there are no hits; needs
an outer side, so inner sheets and sheets seen from both sides confuse it.
`closed`: what parallel looks from all sides leave (`carved_surface`): watertight, hollows full.
`udf`: surface nets of the distances to the hits (`unsigned_surface`). Open and inner sheets stay; `winding` gives each
its outer side.

A normal is what the field says along rays through the point. Evenly spread directions are tried, from outside the
field's box. The answer whose hit comes nearest to the point gives the normal, of equal ones that which looks at the
surface most squarely (derived here). So the normal faces the side from which the surface is seen from outside. A point
that no such ray reaches, inside a closed shape say, is asked about from a small distance, and its normal faces the side
that this happens to be.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.fields import checked_cloud, framed_field
from ddf.fit import winding
from ddf.geometry import carved_surface, rays, transforms, unsigned_surface
from ddf.geometry.mesh_io import Mesh

DIRECTIONS = 32  # asked through a point
NEAR = 0.05  # of the box's longest side: a hit counts that is nearer to the point, and inner points are asked thence
SQUARE = 0.25  # how much of that distance a grazing look costs; small: the nearest hit decides


def normals_at(field: framed_field.FramedField, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
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


Method = Literal["udf", "closed", "poisson"]
METHODS: tuple[Method, ...] = ("udf", "closed", "poisson")
RESOLUTION = 64  # cells along the longest side: no finer than the hits lie
_POISSON_HITS = 5000
_MARGIN = 0.02  # of the longest side, around the hits


def closed(field: framed_field.FramedField, resolution: int = RESOLUTION) -> Mesh:
    """The watertight surface of a field, mesh frame; InputError where there is none."""
    return carved_surface.extract(look(field), *box(field), resolution)


def look(field: framed_field.FramedField) -> carved_surface.Look:
    """Depths of the field along rays of the mesh's frame."""

    def depths(starts: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        return framed_field.query(field, rays.OrientedPoints(starts, directions), ("depth",))[0]["depth"]

    return depths


def box(field: framed_field.FramedField) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Lower and upper corner of the field's box in the mesh's frame."""
    corners = field.field_from_mesh.inverse().apply(transforms.box_corners(field.lower, field.upper))
    return corners.min(axis=0), corners.max(axis=0)


def extract(
    field: framed_field.FramedField,
    cloud: checked_cloud.CheckedCloud,
    method: Literal["poisson", "udf"] = "udf",
    hits: int = _POISSON_HITS,
    resolution: int = RESOLUTION,
) -> Mesh:
    """The surface of a field, in the frame of its hits.

    Args:
      cloud: the hits of `checked_cloud.draw`. hits: how many of them `poisson` asks normals of. resolution: of `udf`.
    Raises:
      InputError: too few hits have a normal, or there is no surface.
    """
    if method == "poisson":
        points = cloud.hits[:hits]
        normals = normals_at(field, points)
        found = normals.any(axis=1)
        if found.sum() < 4:
            raise checks.InputError("the field gives no normals where it sees its surface: fit it for longer")
        return unsigned_surface.poisson(points[found], normals[found])
    lower, upper = cloud.hits.min(axis=0), cloud.hits.max(axis=0)
    margin = _MARGIN * float(np.max(upper - lower))
    return winding.told(unsigned_surface.extract(cloud.distances, lower - margin, upper + margin, resolution))

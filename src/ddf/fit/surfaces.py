"""Triangle meshes of a field, three ways.

`poisson`: screened Poisson through hits with the field's normals. Smooth, and closed but where there are no hits; needs
an outer side, so inner sheets and sheets seen from both sides confuse it.
`closed`: what parallel looks from all sides leave (`carved_surface`): watertight, hollows full.
`udf`: surface nets of the distances to the hits (`unsigned_surface`). Knows no sides: open and inner sheets stay.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.fields import checked_cloud, framed_field
from ddf.fit import cloud_normals
from ddf.geometry import carved_surface, rays, transforms, unsigned_surface
from ddf.geometry.mesh_io import Mesh

Method = Literal["poisson", "closed", "udf"]
METHODS: tuple[Method, ...] = ("poisson", "closed", "udf")
RESOLUTION = 64  # cells along the longest side: no finer than the hits lie
_POISSON_HITS = 5000
_MARGIN = 0.02  # of the longest side, around the hits


def closed(field: framed_field.FramedField, resolution: int = RESOLUTION) -> Mesh:
    """The watertight surface of a field, mesh frame.

    Raises:
      InputError: there is no surface.
    """

    def look(starts: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        return framed_field.query(field, rays.OrientedPoints(starts, directions), ("depth",))[0]["depth"]

    corners = field.field_from_mesh.inverse().apply(transforms.box_corners(field.lower, field.upper))
    return carved_surface.extract(look, corners.min(axis=0), corners.max(axis=0), resolution)


def extract(
    field: framed_field.FramedField,
    cloud: checked_cloud.CheckedCloud,
    method: Literal["poisson", "udf"] = "poisson",
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
        normals = cloud_normals.ask(field, points)
        found = normals.any(axis=1)
        if found.sum() < 4:
            raise checks.InputError("the field gives no normals where it sees its surface: fit it for longer")
        return unsigned_surface.poisson(points[found], normals[found])
    lower, upper = cloud.hits.min(axis=0), cloud.hits.max(axis=0)
    margin = _MARGIN * float(np.max(upper - lower))
    return unsigned_surface.extract(cloud.distances, lower - margin, upper + margin, resolution).mesh

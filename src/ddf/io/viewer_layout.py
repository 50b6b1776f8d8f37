"""Where the fields of a page stand: as a scene says, or side by side."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.fields import field_file
from ddf.geometry import transforms
from ddf.io import viewer_fields, viewer_page

if TYPE_CHECKING:
    from ddf.fields import shape_field
    from ddf.fields.grid import patch_field

ABOUT_SCENE = "Directed distance fields in one scene, evaluated live by this page; each ray shows the nearest surface."
ABOUT_ROW = "Directed distance fields side by side, evaluated live by this page; all are as large as the first."
GAP = 0.05  # between two of a row, of their longest side
_ROW_AZIMUTH = 15.0  # degrees; at 0 a row is seen from its front, and so are shapes that look along x
_RIGHT = {"y": (2, -1.0), "z": (1, 1.0)}  # axis and sign from left to right there, by the axis that points up


def corners(
    shape: "field_file.FieldFile | shape_field.ShapeField | patch_field.PatchField",
) -> Float[np.ndarray, "8 3"]:
    """Those of a field's box, in the frame of its mesh."""
    return shape.field_from_mesh.inverse().apply(transforms.box_corners(shape.lower, shape.upper))


def scene_page(
    name: str,
    fields: Sequence[viewer_fields.BakedField],
    lower: Float[np.ndarray, "3"],
    upper: Float[np.ndarray, "3"],
    up: str = "y",
    cut: bool = False,
) -> viewer_page.Page:
    """The page of several fields.

    Args:
      lower, upper: box that cameras are about, frame of the scene. cut: what lies before it is cut away.
    """
    box = (lower, upper) if cut else None
    return viewer_page.Page(name, ABOUT_SCENE, transforms.box_corners(lower, upper), list(fields), up, box)


def row_page(
    title: str,
    shapes: "Sequence[tuple[str, field_file.FieldFile | shape_field.ShapeField | patch_field.PatchField]]",
    up: str = "y",
    about: str = ABOUT_ROW,
) -> viewer_page.Page:
    """The page of fields in a row from left to right, seen from +x: along -z, or along y where z points up.

    Longest sides of their boxes are made equal to that of the first; the boxes stand on one floor, in the unit of the
    first. A field that stands there several times is in the page once.

    Args:
      shapes: with the names that the page shows. up: axis that points up.
    Raises:
      InputError: there is no field.
    """
    if not shapes:
        raise checks.InputError("a row needs at least one field; got none")
    boxes = [corners(shape) for _, shape in shapes]
    baked = {id(shape): viewer_fields.bake(shape, name) for name, shape in shapes}
    side = float(np.ptp(boxes[0], axis=0).max())
    fields, reach, lower, upper = [], 0.0, np.full(3, np.inf), np.full(3, -np.inf)
    for (name, shape), box in zip(shapes, boxes, strict=True):
        place = _beside(box, side, reach, up)
        stands = place.apply(box)
        axis, sign = _RIGHT[up]
        reach = float((sign * stands[:, axis]).max()) + GAP * side
        lower, upper = np.minimum(lower, stands.min(axis=0)), np.maximum(upper, stands.max(axis=0))
        fields.append(viewer_fields.placed(baked[id(shape)], place, name))
    return viewer_page.Page(title, about, transforms.box_corners(lower, upper), fields, up, azimuth=_ROW_AZIMUTH)


def _beside(box: Float[np.ndarray, "8 3"], side: float, reach: float, up: str) -> transforms.Similarity:
    """What takes a box to the right of `reach`, onto the floor, its middle to x = 0."""
    lower, upper = box.min(axis=0), box.max(axis=0)
    scale, (axis, sign) = side / float((upper - lower).max()), _RIGHT[up]
    at = -scale * lower
    at[0] = -scale * (lower[0] + upper[0]) / 2
    at[axis] = sign * reach - scale * (lower if sign > 0 else upper)[axis]
    return transforms.Similarity(scale, np.eye(3), at)

"""What can be viewed, by its path, as the page that shows it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.export import viewer_fields, viewer_page
from ddf.geometry import transforms
from ddf.shape import shape_field

_ABOUT_SCENE = "Directed distance fields in one scene, evaluated live by this page; each ray shows the nearest surface."
_ABOUT = "A directed distance field, evaluated live by this page: visibility and depth along every ray."


def page(path: Path, up: str = "y") -> viewer_page.Page:
    """The page of a field.

    Args:
      path: folder that `ddf fit` wrote, or its model.safetensors. up: axis of the mesh that points up.
    Raises:
      FileNotFoundError: there is no such field. InputError: it is damaged, or holds something else; it is named.
    """
    if path.suffix == ".onnx":
        raise checks.InputError(f"{path}: a page takes a field's weights; give the folder that `ddf fit` wrote")
    return field_page(shape_field.load(path), name_of(path), up)


def name_of(path: Path) -> str:
    """What a field is called: its folder."""
    return path.resolve().name if path.is_dir() else path.resolve().parent.name


def field_page(shape: shape_field.ShapeField, name: str, up: str = "y") -> viewer_page.Page:
    """The page of one field, in the frame of its mesh."""
    return viewer_page.Page(name, _ABOUT, corners(shape), [viewer_fields.bake(shape, name)], up)


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
    return viewer_page.Page(name, _ABOUT_SCENE, transforms.box_corners(lower, upper), list(fields), up, box)


def corners(shape: shape_field.ShapeField) -> Float[np.ndarray, "8 3"]:
    """Those of a field's box, in the frame of its mesh."""
    return shape.field_from_mesh.inverse().apply(transforms.box_corners(shape.lower, shape.upper))

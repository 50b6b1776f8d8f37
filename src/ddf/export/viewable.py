"""What can be viewed, by its path, as the page that shows it."""

from pathlib import Path

import numpy as np

from ddf.core import checks
from ddf.export import viewer_fields, viewer_page
from ddf.shape import shape_field

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
    shape = shape_field.load(path)
    name = path.name if path.is_dir() else path.parent.name
    return field_page(shape, name, up)


def field_page(shape: shape_field.ShapeField, name: str, up: str = "y") -> viewer_page.Page:
    """The page of one field, in the frame of its mesh."""
    sides = np.stack(np.meshgrid(*zip(shape.lower, shape.upper, strict=True), indexing="ij"), -1).reshape(8, 3)
    corners = shape.field_from_mesh.inverse().apply(sides)
    return viewer_page.Page(name, _ABOUT, corners, [viewer_fields.bake(shape, name)], up)

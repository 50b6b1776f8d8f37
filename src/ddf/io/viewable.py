"""What can be viewed, by its path, as the page that shows it: a field, a model, fields in a row or in a scene."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ddf.core import checks, storage
from ddf.fields import field_file
from ddf.geometry import transforms
from ddf.io import viewer_page

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
    fields: Sequence[viewer_page.BakedField],
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


def side_by_side(
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
    baked = {id(shape): viewer_page.bake(shape, name) for name, shape in shapes}
    side = float(np.ptp(boxes[0], axis=0).max())
    fields, reach, lower, upper = [], 0.0, np.full(3, np.inf), np.full(3, -np.inf)
    for (name, shape), box in zip(shapes, boxes, strict=True):
        place = _beside(box, side, reach, up)
        stands = place.apply(box)
        axis, sign = _RIGHT[up]
        reach = float((sign * stands[:, axis]).max()) + GAP * side
        lower, upper = np.minimum(lower, stands.min(axis=0)), np.maximum(upper, stands.max(axis=0))
        fields.append(viewer_page.placed(baked[id(shape)], place, name))
    return viewer_page.Page(title, about, transforms.box_corners(lower, upper), fields, up, azimuth=_ROW_AZIMUTH)


def _beside(box: Float[np.ndarray, "8 3"], side: float, reach: float, up: str) -> transforms.Similarity:
    """What takes a box to the right of `reach`, onto the floor, its middle to x = 0."""
    lower, upper = box.min(axis=0), box.max(axis=0)
    scale, (axis, sign) = side / float((upper - lower).max()), _RIGHT[up]
    at = -scale * lower
    at[0] = -scale * (lower[0] + upper[0]) / 2
    at[axis] = sign * reach - scale * (lower if sign > 0 else upper)[axis]
    return transforms.Similarity(scale, np.eye(3), at)


_NAMED = 4  # fields of a title
_ABOUT_MODEL = "From one image to a directed distance field, inside this page: nothing leaves this machine."
_ABOUT = "A directed distance field, evaluated live by this page: visibility and depth along every ray."


def page(path: Path, up: str = "y") -> viewer_page.Page:
    """The page of a field or of a reconstruction model.

    Args:
      path: folder that `ddf fit` or `make train` wrote, or its model.safetensors. up: axis of the mesh that points up.
    Raises:
      FileNotFoundError: there is no such field. InputError: it is damaged, or holds something else; it is named.
    """
    file = path if path.name == field_file.MODEL else path / field_file.MODEL
    if file.is_file() and storage.load_metadata(file).get("kind") == "ddf":
        return model_page(file.parent)
    return field_page(field(path), name_of(path), up)


def row_page(paths: Sequence[Path], up: str = "y") -> viewer_page.Page:
    """The page of several fields side by side; one that is named twice stands there twice.

    Args:
      paths: as of `page`, fields alone. up: axis that points up, of all.
    Raises:
      FileNotFoundError: there is no such field. InputError: it is damaged, or no field; it is named.
    """
    missing = next((path for path in paths if not path.exists()), None)
    if missing is not None:
        raise FileNotFoundError(f"{missing}: no such field; a file to write must end in .html")
    loaded = {path: field(path) for path in paths}
    places = [(name_of(path), loaded[path]) for path in paths]
    title = ", ".join(name for name, _ in places) if len(places) <= _NAMED else f"{len(places)} fields"
    return side_by_side(title, places, up)


def field(path: Path) -> "field_file.FieldFile | patch_field.PatchField":
    """A field for a page, by its folder or file; torch is not asked for.

    Raises:
      FileNotFoundError: there is no such field. InputError: it is damaged, or no such field; it is named.
    """
    if path.suffix == ".onnx":
        raise checks.InputError(f"{path}: a page takes a field's weights; give the folder that `ddf fit` wrote")
    file = path if path.name == field_file.MODEL else path / field_file.MODEL
    if not file.is_file() or storage.load_metadata(file).get("kind") != field_file.PATCHES:
        return field_file.read(path)
    from ddf.fields.grid import patch_field

    return patch_field.load(file)


def model_page(folder: Path) -> viewer_page.Page:
    """The page of a reconstruction model: the encoders as ONNX, compared with torch, and the images of its folder.

    Raises:
      InputError: the model is damaged, or its folder has no image `sample_0.png` to begin with.
    """
    from ddf.fields import shape_field
    from ddf.io import onnx_file, onnx_graphs, onnx_parity
    from ddf.models import reconstruction_models

    samples = [file.read_bytes() for file in sorted(folder.glob("sample_*.png"))]
    if not samples:
        raise checks.InputError(f"{folder}: put an RGBA image sample_0.png there, which the page shows first")
    model, image_size, statistics = reconstruction_models.load_ddf(folder)
    graph = onnx_graphs.ModulationsGraph(model.cpu(), image_size, statistics)
    onnx = onnx_file.to_onnx(graph, {})
    onnx_parity.require(onnx_parity.compare(onnx, "modulations", graph, (1,), 0))
    shape = shape_field.conditioned(model.field, None, 1.0)
    encoders = viewer_page.Encoders(onnx, image_size, samples, float(model.camera_head.mean[2]), statistics is not None)
    fields = [viewer_page.bake(shape, name_of(folder))]
    return viewer_page.Page(name_of(folder), _ABOUT_MODEL, corners(shape), fields, encoders=encoders)


def name_of(path: Path) -> str:
    """What a field is called: its folder."""
    return path.resolve().name if path.is_dir() else path.resolve().parent.name


def field_page(
    shape: "field_file.FieldFile | shape_field.ShapeField | patch_field.PatchField", name: str, up: str = "y"
) -> viewer_page.Page:
    """The page of one field, in the frame of its mesh."""
    return viewer_page.Page(name, _ABOUT, corners(shape), [viewer_page.bake(shape, name)], up)

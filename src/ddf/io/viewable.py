"""What can be viewed, by its path, as the page that shows it."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ddf.core import checks, storage
from ddf.fields import field_file
from ddf.io import viewer_fields, viewer_layout, viewer_page

if TYPE_CHECKING:
    from ddf.fields import shape_field
    from ddf.fields.grid import patch_field

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
    return viewer_layout.row_page(title, places, up)


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
    from ddf.models import out_of_distribution
    from ddf.reconstruction import one_image

    samples = [file.read_bytes() for file in sorted(folder.glob("sample_*.png"))]
    if not samples:
        raise checks.InputError(f"{folder}: put an RGBA image sample_0.png there, which the page shows first")
    model, image_size = one_image.load(folder)
    statistics = out_of_distribution.TrainingStatistics.read(folder)
    graph = onnx_graphs.ModulationsGraph(model.cpu(), image_size, statistics)
    onnx = onnx_file.to_onnx(graph, {})
    onnx_parity.require(onnx_parity.compare(onnx, "modulations", graph, (1,), 0))
    shape = shape_field.conditioned(model.field, None, 1.0)
    encoders = viewer_page.Encoders(onnx, image_size, samples, float(model.camera_head.mean[2]), statistics is not None)
    fields = [viewer_fields.bake(shape, name_of(folder))]
    return viewer_page.Page(name_of(folder), _ABOUT_MODEL, viewer_layout.corners(shape), fields, encoders=encoders)


def name_of(path: Path) -> str:
    """What a field is called: its folder."""
    return path.resolve().name if path.is_dir() else path.resolve().parent.name


def field_page(
    shape: "field_file.FieldFile | shape_field.ShapeField | patch_field.PatchField", name: str, up: str = "y"
) -> viewer_page.Page:
    """The page of one field, in the frame of its mesh."""
    return viewer_page.Page(name, _ABOUT, viewer_layout.corners(shape), [viewer_fields.bake(shape, name)], up)

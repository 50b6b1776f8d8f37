"""The field that a command reads: by onnxruntime where that will do, which starts faster than torch, else by torch."""

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ddf.fields import framed_field

ONNX = "field.onnx"  # of a folder, beside its weights


def framed(path: Path, outputs: Collection[str]) -> "framed_field.FramedField":
    """The field of an ONNX file or of a folder, which gives these outputs and the visibility.

    Raises:
      FileNotFoundError, InputError: as `stored_fields.load` and `onnx_field.load`.
    """
    file = path / ONNX if path.is_dir() else path
    if file.suffix == ".onnx" and file.is_file():
        from ddf.io import onnx_field

        found = onnx_field.load(file)
        if file == path or {"visibility", *outputs} <= set(found.outputs):
            return found
    from ddf.fields import stored_fields

    return stored_fields.load(path)

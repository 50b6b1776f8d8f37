"""Fields of one shape by their files, of either kind: a sine network's (`shape_field`), patches (`patch_field`).

What only the other kind needs is not imported.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from ddf.core import storage
from ddf.fields import field_file

if TYPE_CHECKING:
    from ddf.fields import shape_field
    from ddf.fields.grid import patch_field


def load(path: Path) -> "shape_field.ShapeField | patch_field.PatchField":
    """A field from its file, or from the folder that `ddf fit` wrote."""
    file = field_file.file_of(path)
    if file.is_file() and storage.load_metadata(file).get("kind") == field_file.PATCHES:
        from ddf.fields.grid import patch_field

        return patch_field.load(file)
    field_file.read(path)  # what is no field is told before torch is asked for
    from ddf.fields import shape_field

    return shape_field.load(path)

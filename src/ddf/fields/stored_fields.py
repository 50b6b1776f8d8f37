"""Fields of one shape by their files, of either kind: a sine network's (`shape_field`), patches (`patch_field`).

What only the other kind needs is not imported.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from jaxtyping import Float

from ddf.core import storage
from ddf.fields import field_file

if TYPE_CHECKING:
    from ddf.fields import cloud_projection, shape_field
    from ddf.fields.grid import patch_field

CLOUD: dict[str, Any] = {  # of `cloud_projection.CloudConfig`, whose defaults are the paper's
    "cycles": 3,
    "num_directions": 16,
    "jitter": 0.2,
    "recheck": (0.1,),
    "spread": 0.75,
    "crowding": 1.0,
    "least_confidence": 0.1,
    "aimed": 0.5,
    "temperature": 0.05,
    "inverse_depth": 0.05,
}


def cloud_config() -> "cloud_projection.CloudConfig":
    """How clouds are drawn."""
    from ddf.fields import cloud_projection

    return cloud_projection.CloudConfig(**CLOUD)


def load(path: Path) -> "shape_field.ShapeField | patch_field.PatchField":
    """A field from its file, or from the folder that `ddf fit` wrote."""
    file = field_file.file_of(path)
    if file.is_file() and storage.load_metadata(file).get("kind") == field_file.PATCHES:
        from ddf.fields.grid import patch_field

        return patch_field.load(file)
    field_file.read(path)  # what is no field is told before torch is asked for
    from ddf.fields import shape_field

    return shape_field.load(path)


def save(shape: "shape_field.ShapeField | patch_field.PatchField", folder: Path) -> Path:
    """Write a field's file into a folder, as `ddf fit` does."""
    own = {name: value for name, value in shape.record.items() if name != "checksum"}  # it is of the old file
    record = {"fingerprint": "", "seed": 0, "sources": {}, **own}
    if record.get("kind") == field_file.PATCHES:
        path = folder / field_file.MODEL
        storage.save_tensors(path, cast("patch_field.PatchField", shape).arrays, record)
        return path
    from ddf.fields import shape_field

    return shape_field.save(cast(shape_field.ShapeField, shape), folder, record)


def points(
    shape: "shape_field.ShapeField | patch_field.PatchField", count: int, seed: int = 0
) -> Float[np.ndarray, "count 3"]:
    """Points on the surface, mesh frame: a network's by projection, patches' by area."""
    if shape.record.get("kind") == field_file.PATCHES:
        return cast("patch_field.PatchField", shape).points(count, seed)
    from ddf.fields import shape_field

    return shape_field.cloud(cast(shape_field.ShapeField, shape), count, cloud_config(), seed)

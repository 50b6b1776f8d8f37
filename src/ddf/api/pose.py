"""Where an object that is known stands in a scan."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from ddf.api import inputs
from ddf.api.field import Field
from ddf.core import checks, extras
from ddf.geometry import scans


def recover_pose(
    field: Field,
    scan: str | Path | scans.Scan,
    start: npt.ArrayLike,
    *,
    resize: bool = False,
    noise: float = 0.0,
    seed: int = 0,
) -> Float[np.ndarray, "*k 4 4"]:
    """Where an object stands in a scan, by descent through its field from a rough pose. Needs torch.

    Args:
      field: of the object, by its own file: an ONNX file alone has no gradients.
      scan: as of `complete`. Hits far from the object are left out.
      start: 4x4, from the frame of the field to that of the scan; (k, 4, 4) of as many such objects in it.
      resize: whether the scale may change too.
      noise: standard deviation of a range, unit of the scan.
      seed: the same seed gives the same pose.
    Returns:
      4x4, from the frame of the field to that of the scan, or (k, 4, 4).
    Raises:
      FileNotFoundError: there is no such scan.
      ValueError: the scan, the start or the field is of another kind, or too few rays end near the object.

    Example:
      >>> import ddf, numpy as np
      >>> rabbit = ddf.load("rabbit")
      >>> start = np.eye(4)
      >>> start[0, 3] = 0.1
      >>> found = ddf.recover_pose(rabbit, ddf.depth_camera(rabbit, size=32), start)
      >>> bool(abs(found - np.eye(4)).max() < 0.02)
      True
    """
    if not 0 <= noise < np.inf:
        raise checks.InputError(f"noise must be 0 or more, in the unit of the scan; got {noise}")
    given = scan if isinstance(scan, scans.Scan) else scans.read(Path(scan))
    places = inputs.poses("start", start)
    with extras.named():
        from ddf.fields import shape_field
        from ddf.fit import completion
    shape = field._weights
    if isinstance(shape, shape_field.ShapeField) and shape.modulations is not None:
        raise checks.InputError("recover_pose takes the field of one shape, such as `ddf fit` makes")
    doubt = completion.Doubt(growth=completion.Doubt.growth if resize else 0.0, anyhow=True)
    several = [place.compose(shape.field_from_mesh.inverse()) for place in places]
    found = completion.find(shape, given, several, doubt, noise, seed)
    matrices = np.stack([each.compose(shape.field_from_mesh).to_matrix() for each in found])
    return matrices if np.ndim(start) == 3 else matrices[0]

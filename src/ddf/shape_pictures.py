"""Pictures of a fitted field: any output of `shape_field` as RGB pixels on white."""

import numpy as np
from jaxtyping import Float

from ddf import strips

_NEGATIVE, _ZERO, _POSITIVE = np.array([[0.13, 0.32, 0.67], [0.87, 0.87, 0.85], [0.75, 0.22, 0.13]])
_SIGNED_PERCENTILE = 95.0  # of |curvature| is full colour: edges of a mesh are much sharper than all the rest


def signed_picture(
    values: Float[np.ndarray, "size size"], visibility: Float[np.ndarray, "size size"]
) -> strips.Picture:
    """Blue below 0, grey at 0, red above; white where visibility is below 1/2."""
    seen = visibility >= 0.5
    full = np.percentile(np.abs(values[seen]), _SIGNED_PERCENTILE) if seen.any() else 0.0
    level = np.clip(values / (full or 1.0), -1.0, 1.0)[..., None]
    colour = _ZERO + np.maximum(level, 0.0) * (_POSITIVE - _ZERO) + np.maximum(-level, 0.0) * (_NEGATIVE - _ZERO)
    return np.rint(np.where(seen[..., None], colour, 1.0) * 255).astype(np.uint8)


def picture(name: str, images: dict[str, Float[np.ndarray, "size size ..."]]) -> strips.Picture:
    """One of `shape_field.OUTPUTS`; `images` holds it and the visibility."""
    visibility = images["visibility"]
    if name == "visibility":
        return strips.visibility_picture(visibility)
    if name == "depth":
        return strips.depth_picture(images["depth"], visibility)
    if name == "normals":
        return strips.normals_picture(images["normals"], visibility)
    return signed_picture(images[name], visibility)

"""Pictures of a fitted field: any of its outputs as RGB pixels on white."""

import numpy as np
from jaxtyping import Bool, Float, UInt8

from ddf.fields import field_outputs
from ddf.pictures import viridis

Picture = UInt8[np.ndarray, "_ _ 3"]  # square, of any size

_NEGATIVE, _ZERO, _POSITIVE = np.array([[0.13, 0.32, 0.67], [0.87, 0.87, 0.85], [0.75, 0.22, 0.13]])
_SIGNED_PERCENTILE = 95.0  # of |curvature| is full colour: edges of a mesh are much sharper than all the rest


def to_bytes(rgb: Float[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """Colours in [0, 1], clipped, as bytes."""
    return np.rint(np.clip(rgb, 0.0, 1.0) * 255).astype(np.uint8)


def visibility_picture(visibility: Float[np.ndarray, "size size"]) -> Picture:
    """Probability from white (0) to dark (1)."""
    return to_bytes(1.0 - visibility[..., None] * (1.0 - np.array([0.13, 0.17, 0.25])))


def depth_picture(depth: Float[np.ndarray, "size size"], visibility: Float[np.ndarray, "size size"]) -> Picture:
    """Viridis over the range of the visible pixels, near yellow, far violet; white where visibility is below 1/2."""
    seen = (visibility >= 0.5) & np.isfinite(depth)
    if not seen.any():
        return to_bytes(np.ones((*depth.shape, 3)))
    near, far = np.percentile(depth[seen], [1, 99])
    level = np.clip((np.where(seen, depth, far) - near) / max(far - near, 1e-12), 0.0, 1.0)
    return to_bytes(np.where(seen[..., None], viridis.colours(1.0 - level), 1.0))


def normals_picture(normals: Float[np.ndarray, "size size 3"], visibility: Float[np.ndarray, "size size"]) -> Picture:
    """(n + 1)/2 as RGB, field axes; white where visibility is below 1/2."""
    return to_bytes(np.where((visibility >= 0.5)[..., None], (normals + 1.0) / 2.0, 1.0))


def signed_picture(values: Float[np.ndarray, "size size"], visibility: Float[np.ndarray, "size size"]) -> Picture:
    """Blue below 0, grey at 0, red above; white where visibility is below 1/2."""
    seen = visibility >= 0.5
    full = np.percentile(np.abs(values[seen]), _SIGNED_PERCENTILE) if seen.any() else 0.0
    return _diverging(np.clip(values / (full or 1.0), -1.0, 1.0), seen)


def weight_picture(weight: Float[np.ndarray, "size size"], visibility: Float[np.ndarray, "size size"]) -> Picture:
    """w_1 from blue (0: depth is d_2) over grey (1/2) to red (1: d_1); white where visibility is below 1/2."""
    return _diverging(2.0 * weight - 1.0, visibility >= 0.5)


def _diverging(levels: Float[np.ndarray, "size size"], shown: Bool[np.ndarray, "size size"]) -> Picture:
    """Levels in [-1, 1] from blue over grey to red, on white."""
    level = levels[..., None]
    colour = _ZERO + np.maximum(level, 0.0) * (_POSITIVE - _ZERO) + np.maximum(-level, 0.0) * (_NEGATIVE - _ZERO)
    return np.rint(np.where(shown[..., None], colour, 1.0) * 255).astype(np.uint8)


def depth_pictures(*depths: Float[np.ndarray, "size size"]) -> list[Picture]:
    """Depth images of one scene on one scale, so that their colours compare: near yellow, far violet, `inf` white."""
    finite = np.concatenate([depth[np.isfinite(depth)] for depth in depths])
    near, far = np.percentile(finite, [1, 99]) if len(finite) else (0.0, 1.0)
    pictures = []
    for depth in depths:
        shown = np.isfinite(depth)
        level = np.clip((np.where(shown, depth, far) - near) / max(far - near, 1e-12), 0.0, 1.0)
        colour = np.where(shown[..., None], viridis.colours(1.0 - level), 1.0)
        pictures.append(np.rint(colour * 255).astype(np.uint8))
    return pictures


def picture(name: str, images: dict[str, Float[np.ndarray, "size size ..."]]) -> Picture:
    """One of `field_outputs.OUTPUTS`, drawn as its kind is; `images` holds it and the visibility."""
    draw = {
        "probability": lambda values, _: visibility_picture(values),
        "depth": depth_picture,
        "directions": normals_picture,
        "share": weight_picture,
        "signed": signed_picture,
    }
    return draw[field_outputs.OUTPUTS[name].kind](images[name], images["visibility"])

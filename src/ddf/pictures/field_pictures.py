"""Pictures of a fitted field: any of its outputs as RGB pixels on white.

The colour map viridis (van der Walt, Smith and Firing 2015, CC0) stands here, so that pictures need no matplotlib.
"""

import numpy as np
from jaxtyping import Bool, Float, UInt8

from ddf.fields import field_outputs

_HEX = (  # RGB of 256 levels
    "44015444025645045745055946075a46085c460a5d460b5e470d60470e6147106347116447136548146748166848176948186a481a6c"
    "481b6d481c6e481d6f481f70482071482173482374482475482576482677482878482979472a7a472c7a472d7b472e7c472f7d46307e"
    "46327e46337f463480453581453781453882443983443a83443b84433d84433e85423f85424086424186414287414487404588404688"
    "3f47883f48893e49893e4a893e4c8a3d4d8a3d4e8a3c4f8a3c508b3b518b3b528b3a538b3a548c39558c39568c38588c38598c375a8c"
    "375b8d365c8d365d8d355e8d355f8d34608d34618d33628d33638d32648e32658e31668e31678e31688e30698e306a8e2f6b8e2f6c8e"
    "2e6d8e2e6e8e2e6f8e2d708e2d718e2c718e2c728e2c738e2b748e2b758e2a768e2a778e2a788e29798e297a8e297b8e287c8e287d8e"
    "277e8e277f8e27808e26818e26828e26828e25838e25848e25858e24868e24878e23888e23898e238a8d228b8d228c8d228d8d218e8d"
    "218f8d21908d21918c20928c20928c20938c1f948c1f958b1f968b1f978b1f988b1f998a1f9a8a1e9b8a1e9c891e9d891f9e891f9f88"
    "1fa0881fa1881fa1871fa28720a38620a48621a58521a68522a78522a88423a98324aa8325ab8225ac8226ad8127ad8128ae8029af7f"
    "2ab07f2cb17e2db27d2eb37c2fb47c31b57b32b67a34b67935b77937b87838b9773aba763bbb753dbc743fbc7340bd7242be7144bf70"
    "46c06f48c16e4ac16d4cc26c4ec36b50c46a52c56954c56856c66758c7655ac8645cc8635ec96260ca6063cb5f65cb5e67cc5c69cd5b"
    "6ccd5a6ece5870cf5773d05675d05477d1537ad1517cd2507fd34e81d34d84d44b86d54989d5488bd6468ed64590d74393d74195d840"
    "98d83e9bd93c9dd93ba0da39a2da37a5db36a8db34aadc32addc30b0dd2fb2dd2db5de2bb8de29bade28bddf26c0df25c2df23c5e021"
    "c8e020cae11fcde11dd0e11cd2e21bd5e21ad8e219dae319dde318dfe318e2e418e5e419e7e419eae51aece51befe51cf1e51df4e61e"
    "f6e620f8e621fbe723fde725"
)
_TABLE = np.frombuffer(bytes.fromhex(_HEX), np.uint8).reshape(-1, 3) / 255


def colours(levels: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape 3"]:
    """RGB in [0, 1] of levels in [0, 1]."""
    return _TABLE[np.minimum((np.asarray(levels) * len(_TABLE)).astype(np.int64), len(_TABLE) - 1)]


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
    return depth_pictures(np.where(visibility >= 0.5, depth, np.inf))[0]


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
        colour = np.where(shown[..., None], colours(1.0 - level), 1.0)
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

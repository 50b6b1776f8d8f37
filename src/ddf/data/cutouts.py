"""Pictures of an object, cut out: by their own alpha, by a mask, or by what differs from the background at the border.

PNG, WebP, JPEG, GIF and BMP of any mode, turned as their EXIF record says. The background is a smooth colour: a
polynomial of second degree in x and y per channel, fitted to the picture's rim, in which the object hardly lies, by
least squares of the half that fits best. What differs from it stands out; what does not and touches the rim is
background, as are holes that fit it closely (derived here).
"""

import logging
import warnings
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, UInt8
from PIL import Image, ImageColor, ImageOps, UnidentifiedImageError
from scipy import ndimage

from ddf.core import checks
from ddf.data import shapenet

LOGGER = logging.getLogger(__name__)
MAX_PIXELS = 50_000_000  # of a picture: 200 MiB as RGBA
BACKGROUNDS = ("auto", "white", "border")  # or a colour
_FORMATS = ("PNG", "WEBP", "JPEG", "GIF", "BMP")
_LARGE = 1024  # pixels a side: larger pictures are made smaller, an encoder sees 64 or 224
_OPAQUE = 128  # alpha from which on a pixel is the object's
_RIM = 0.03  # of the longer side
_LEAST, _SPREADS = 20.0, 6.0  # difference that stands out: levels of 255, and in deviations of the rim
_SPECK = 0.01  # of the largest piece: smaller ones are dust
_ACROSS, _MOST_SHARE = 16, 0.9  # pixels across that some piece of an object has at least; its share of the picture
_SECOND, _APART = 0.2, 137  # share of the largest piece; the longer side over a gap: of a piece that is another object
_OTHERWISE = "; give --mask FILE, --background COLOUR (such as white), or a picture whose alpha masks the object"


def read(path: Path, mask: Path | None = None, background: str = "auto") -> UInt8[np.ndarray, "h w 4"]:
    """A picture whose alpha masks the object; RGB is 0 where alpha is.

    Args:
      mask: a picture of the same shape, light (or opaque, where it has an alpha) on the object. background: `auto`, the
        picture's own alpha, or `border` where it has none; `white`; `border`, the colour of the rim; or a colour,
        `#rrggbb` or a name, of the background.
    Raises:
      InputError: the file is missing, damaged or too large; no object stands out, or nothing but one; it is named.
    """
    picture = _opened(path)
    pixels = np.array(picture)
    alpha = pixels[..., 3] if mask is None else _mask(mask, picture.size)
    masked = mask is not None or (background == "auto" and int(alpha.min()) < 255)
    if masked and mask is None and (alpha >= _OPAQUE).mean() > _MOST_SHARE:
        LOGGER.warning("%s: its alpha masks next to nothing, so the rim tells the background", path)
        masked = False
    if not masked:
        flat = Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture)
        pixels = _standing_out(np.array(flat)[..., :3].astype(np.float64), colour(background))
        alpha = pixels[..., 3]
    _judge(alpha, mask or path, masked)
    pixels[..., 3] = alpha
    pixels[alpha == 0] = 0
    return pixels


def _judge(alpha: UInt8[np.ndarray, "h w"], path: Path, masked: bool) -> None:
    """InputError of what is no object; a remark where one is cut off, or not alone."""
    opaque = alpha >= _OPAQUE
    boxes = ndimage.find_objects(ndimage.label(opaque, np.ones((3, 3)))[0])
    across = max((side.stop - side.start for box in boxes for side in box), default=0)
    if across < _ACROSS or opaque.mean() > _MOST_SHARE:
        told = f"{across} pixels across, {opaque.mean():.0%} of all; at least {_ACROSS}, at most {_MOST_SHARE:.0%}"
        told = f"at most {alpha.max()} of 255; the object's are {_OPAQUE} or more" if masked and not across else told
        how = "no object is masked" if masked else "no object stands out from the background"
        raise checks.InputError(f"{path}: {how} (what does is {told}){_OTHERWISE}")
    if 0 < sum(edge.any() for edge in (opaque[0], opaque[-1], opaque[:, 0], opaque[:, -1])) < 4:  # else trimmed
        LOGGER.warning("%s: the object reaches the border; where it is cut off, expect errors", path)
    near = ndimage.binary_dilation(opaque, np.ones((3, 3)), max(opaque.shape) // _APART or 1)
    second, first = np.sort(np.bincount(ndimage.label(near)[0][opaque]))[-2:]  # no pixel has label 0
    if second > _SECOND * first:
        LOGGER.warning("%s: several objects? The second has %.0f %% of the first's pixels", path, 100 * second / first)


def colour(background: str) -> tuple[int, int, int] | None:
    """RGB of `--background`; None where the rim tells it. InputError where there is no such colour."""
    if background in ("auto", "border"):
        return None
    try:
        return ImageColor.getrgb(background)[:3]
    except ValueError as error:
        known = f"{', '.join(BACKGROUNDS)}, a colour's name or #rrggbb"
        raise checks.InputError(f"background must be {known}; got {background!r}") from error


def _opened(path: Path) -> Image.Image:
    """As it is to be seen, in 8 bits, at most `_LARGE` pixels a side."""
    picture = _whole(path)
    if picture.mode.startswith("I"):  # 16 bits of grey, which Pillow would clip
        picture = Image.fromarray((np.asarray(picture).astype(np.int64) >> 8).astype(np.uint8))
    picture = picture.convert("RGBA")
    if max(picture.size) <= _LARGE:
        return picture
    width, height = (max(1, round(length * _LARGE / max(picture.size))) for length in picture.size)
    return picture.resize((width, height), Image.Resampling.BILINEAR, reducing_gap=2.0)


def _whole(path: Path) -> Image.Image:
    """As it is to be seen, in the mode and the size of the file."""
    if not path.is_file():
        raise checks.InputError(f"{path}: no such image")
    checks.require_content(path)
    try:
        # Pillow's warnings say nothing new: the size is judged here, a damaged record turns nothing.
        with warnings.catch_warnings(action="ignore"), Image.open(path, formats=_FORMATS) as opened:
            if opened.width * opened.height > MAX_PIXELS:
                size = f"{opened.width} x {opened.height} pixels"
                raise checks.InputError(f"{path}: {size}; at most {MAX_PIXELS} are read: make it smaller")
            return ImageOps.exif_transpose(opened)
    except checks.InputError:
        raise
    except shapenet.DAMAGED as error:
        told = "damaged, or of another kind" if isinstance(error, UnidentifiedImageError) else error
        known = ", ".join(_FORMATS)
        raise checks.InputError(f"{path}: not a readable image ({told}); {known} are read: save it as PNG") from error


def _mask(path: Path, size: tuple[int, int]) -> UInt8[np.ndarray, "h w"]:
    """Its alpha, or its lightness where that is the same everywhere: of two values the higher one is the object, of a
    palette of colours all but black, of 16 bits the high ones unless all are 255 or less.
    """
    found = _whole(path)
    if abs(found.width / found.height - size[0] / size[1]) > 0.02 * size[0] / size[1]:
        raise checks.InputError(f"{path}: {found.width} x {found.height} pixels, not of the picture's shape {size}")
    if found.mode.startswith("I"):
        light = np.asarray(found).astype(np.int64)
    else:
        coloured, rgba = found.mode == "P", np.asarray(found.convert("RGBA"))
        light = rgba[..., 3] if rgba[..., 3].min() < 255 else np.asarray(found.convert("L"))
        if coloured and rgba[..., 3].min() == 255 and np.ptp(rgba[..., :3], axis=-1).any():
            light = rgba[..., :3].any(axis=-1)
    low, high = int(light.min()), int(light.max())
    if low < high and ((light == low) | (light == high)).all():
        light = (light == high) * 255
    elif high > 255:
        light = light >> 8
    return np.array(Image.fromarray(light.astype(np.uint8)).resize(size, Image.Resampling.BILINEAR))


def _standing_out(rgb: Float[np.ndarray, "h w 3"], plain: tuple[int, int, int] | None) -> UInt8[np.ndarray, "h w 4"]:
    """RGBA of what differs from the background, of one colour or as the rim tells it, which is taken out of edges."""
    behind, spread = (np.broadcast_to(np.array(plain, float), rgb.shape), 0.0) if plain else _behind(rgb)
    apart = np.linalg.norm(rgb - behind, axis=2)
    bound = max(_LEAST, _SPREADS * spread)
    like, _ = ndimage.label(apart <= bound)
    rim = np.unique(np.concatenate([like[0], like[-1], like[:, 0], like[:, -1]]))
    outside = np.isin(like, rim[rim > 0])
    holes = _holes(like, outside, apart, bound)
    alpha = _without_dust(~(outside | holes), apart)
    own = np.clip(behind + (rgb - behind) / np.maximum(alpha, 1 / 255)[..., None], 0, 255)
    return np.rint(np.concatenate([own, 255 * alpha[..., None]], axis=2)).astype(np.uint8)


def _behind(rgb: Float[np.ndarray, "h w 3"]) -> tuple[Float[np.ndarray, "h w 3"], float]:
    """The background as the rim tells it, and how far the rim's better half is from that."""
    height, width = rgb.shape[:2]
    y, x = np.meshgrid(np.linspace(-1, 1, height), np.linspace(-1, 1, width), indexing="ij")
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    wide = max(2, round(_RIM * max(height, width)))
    rim = np.ones((height, width), dtype=bool)
    rim[wide:-wide, wide:-wide] = False
    seen, levels = terms[rim], rgb[rim]
    fitted = np.zeros((6, 3))
    fitted[0] = np.median(levels, axis=0)
    for _ in range(4):
        near = np.linalg.norm(levels - seen @ fitted, axis=1)
        better = near <= np.median(near)
        fitted = np.linalg.lstsq(seen[better], levels[better], rcond=None)[0]
    near = np.linalg.norm(levels - seen @ fitted, axis=1)
    return terms @ fitted, float(np.median(near))


def _holes(
    like: np.ndarray, outside: Bool[np.ndarray, "h w"], apart: Float[np.ndarray, "h w"], bound: float
) -> Bool[np.ndarray, "h w"]:
    """Pieces within the object whose mean is within half the bound: light parts of it are rarely the background's."""
    numbers = np.arange(1, like.max() + 1)
    close = ndimage.mean(apart, like, numbers) <= bound / 2
    return np.isin(like, numbers[close]) & ~outside


def _without_dust(found: Bool[np.ndarray, "h w"], apart: Float[np.ndarray, "h w"]) -> Float[np.ndarray, "h w"]:
    """Alpha in [0, 1] of the large pieces; at their edge a pixel is as opaque as it stands out by its neighbours."""
    pieces, count = ndimage.label(found, np.ones((3, 3)))
    if not count:
        return np.zeros(found.shape)
    sizes = np.bincount(pieces.ravel())[1:]
    kept = np.isin(pieces, 1 + np.flatnonzero(sizes >= _SPECK * sizes.max()))
    edge = ndimage.binary_dilation(kept) & ~ndimage.binary_erosion(kept, np.ones((3, 3)))
    most = np.maximum(ndimage.maximum_filter(np.where(kept, apart, 0.0), 5), 1e-9)
    return np.where(edge, np.minimum(apart / most, 1.0), kept)

"""Images as files: pictures, depths as 16-bit numbers, and arrays."""

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddf.core import errors

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float, UInt8

PICTURES = {".png": "PNG", ".webp": "WEBP"}
ARRAYS = (".npz", ".exr")
_LEVELS = 65535  # of 16 bits, beside 0
_AXES = "XYZ"


def encode(frames: "Sequence[UInt8[np.ndarray, 'height width 3']]", suffix: str, frame_ms: int = 0) -> bytes:
    """Pictures as one file of the `PICTURES`, moving and looping where there are several; every pixel is kept."""
    from PIL import Image

    buffer = io.BytesIO()
    first, *others = (Image.fromarray(frame) for frame in frames)
    more: dict[str, Any] = {"lossless": True} if suffix == ".webp" else {}
    if others:
        more |= {"save_all": True, "append_images": others, "duration": frame_ms, "loop": 0}
    first.save(buffer, format=PICTURES[suffix], **more)
    return buffer.getvalue()


def depth_png(depth: "Float[np.ndarray, 'height width']") -> tuple[bytes, float]:
    """Depth as a PNG of 16 bits, and its step: depth = value x step, and 0 where nothing is seen.

    The step is the largest depth over 65,535; the file says it too, as its text `depth_step`, and that depth is along
    the rays, as `scans` reads it.
    """
    import numpy as np
    from PIL import Image, PngImagePlugin

    seen = np.isfinite(depth)
    step = float(depth[seen].max() / _LEVELS) if seen.any() else float("nan")
    levels = np.where(seen, np.rint(np.where(seen, depth, 0.0) / (step if step > 0 else 1.0)), 0.0)
    note = PngImagePlugin.PngInfo()
    note.add_text("depth_step", repr(step))
    note.add_text("depth_along", "the ray through each pixel, not the optical axis")
    buffer = io.BytesIO()
    Image.fromarray(levels.astype(np.uint16)).save(buffer, format="PNG", pnginfo=note)
    return buffer.getvalue(), step


def npz(arrays: "Mapping[str, np.ndarray]") -> bytes:
    """Named arrays as they are."""
    import numpy as np

    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue()


def write_exr(path: Path, images: "Mapping[str, Float[np.ndarray, 'height width ...']]") -> None:
    """Images as float32 channels of one OpenEXR file: `depth`, `normals.X`, `normals.Y`, ..."""
    import numpy as np

    from ddf.core import storage

    try:
        import OpenEXR
    except ModuleNotFoundError as error:
        raise errors.InputError(f"{path}: .exr needs the package OpenEXR: pip install openexr") from error
    channels = {}
    for name, values in images.items():
        planes = {name: values} if values.ndim == 2 else {f"{name}.{a}": values[..., i] for i, a in enumerate(_AXES)}
        channels |= {key: np.ascontiguousarray(plane, dtype=np.float32) for key, plane in planes.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with storage.atomic_path(path) as temporary, OpenEXR.File(header, channels) as file:
        file.write(str(temporary))

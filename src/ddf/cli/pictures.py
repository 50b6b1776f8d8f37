"""Pictures as the bytes of a file."""

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import UInt8

FORMATS = {".png": "PNG", ".webp": "WEBP"}


def encode(picture: "UInt8[np.ndarray, 'height width 3']", suffix: str) -> bytes:
    """A picture as a file of one of the `FORMATS`; both keep every pixel."""
    from PIL import Image

    buffer = io.BytesIO()
    more = {"lossless": True} if suffix == ".webp" else {}
    Image.fromarray(picture).save(buffer, format=FORMATS[suffix], **more)
    return buffer.getvalue()

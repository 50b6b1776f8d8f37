"""The first picture of a page, in the page itself: what its own shading (`viewer/src/shading.ts`) draws of a field."""

import io

import numpy as np
from PIL import Image

from ddf.fields import framed_field
from ddf.geometry import cameras

ELEVATION = 25.0  # of the page's first camera, degrees
_SIZE = 384  # pixels a side
_DARK, _CLAY = np.array([24.0, 26.0, 32.0]), np.array([214.0, 201.0, 182.0])


def first(field: framed_field.FramedField, azimuth: float, up: str = "y") -> bytes:
    """Clay under a light at the camera, clear where nothing is seen, as WebP.

    Args:
      field: with normals. azimuth: of the camera, degrees; its radius is that from which the picture holds the box.
    """
    camera = (azimuth, ELEVATION, framed_field.framing_radius(field, azimuth, ELEVATION, up))
    found, _ = framed_field.render(field, camera, _SIZE, ("depth", "normals"), up)
    _, directions = framed_field.camera_rays(field, camera, _SIZE, up)
    looks = field.field_from_mesh.inverse().apply_directions(directions).reshape(_SIZE, _SIZE, 3)
    above = framed_field.upright(up) @ cameras.rotation(*np.deg2rad(np.array(camera[:2])))[1]
    towards, sky = -(found["normals"] * looks).sum(-1), found["normals"] @ above
    level = np.clip(0.18 + 0.7 * np.maximum(towards, 0) + 0.12 * (0.5 + 0.5 * sky), 0, 1)[..., None]
    seen = np.isfinite(found["depth"])[..., None]
    rgba = seen * np.concatenate([_DARK + level * (_CLAY - _DARK), np.full_like(level, 255.0)], axis=-1)
    buffer = io.BytesIO()
    Image.fromarray(np.rint(rgba).astype(np.uint8), "RGBA").save(buffer, "WEBP", quality=80, method=6)
    return buffer.getvalue()

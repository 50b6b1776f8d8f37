"""Pictures of what a sensor saw of an object, and of the whole that was made of it."""

import numpy as np
from jaxtyping import Float, Int, UInt8

from ddf.geometry import cameras

SCAN, SEEN, INFERRED = (60, 60, 60), (43, 108, 176), (221, 107, 32)
_SPLAT = 1 / 84  # of a picture's side: that of a point


def dots(
    points: Float[np.ndarray, "n 3"],
    colours: Int[np.ndarray, "n 3"],
    size: int,
    azimuth_deg: float,
    elevation_deg: float,
) -> UInt8[np.ndarray, "size size 3"]:
    """Points less than half a unit from 0, Y up, as small squares, the farthest first, darker the farther they are."""
    near = np.linalg.norm(points, axis=1) < 0.5
    points, colours = points[near], colours[near]
    right, up, back = cameras.rotation(*np.radians((azimuth_deg, elevation_deg)))
    order = np.argsort(points @ back)
    depth = (points @ back)[order]
    shade = 0.55 + 0.45 * (depth - depth.min(initial=np.inf)) / max(np.ptp(depth) if len(depth) else 0.0, 1e-12)
    image, splat = np.full((size, size, 3), 255, np.uint8), round(size * _SPLAT)
    for x, y, colour in zip(points[order] @ right, points[order] @ up, shade[:, None] * colours[order], strict=True):
        column, row = int(size * (0.5 + x)), int(size * (0.5 - y))
        image[row : row + splat, column : column + splat] = 255 - (255 - colour) * 0.85
    return image

"""Writes docs/complete.webp: a public chair as a depth camera sees it, completed, and whole.

It needs the packages of `ddf shapes get`.
"""

import sys
from pathlib import Path

import numpy as np
from jaxtyping import Float
from PIL import Image

import ddf

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from bench.reconstruction import complete
from ddf.data.public import manifest
from ddf.geometry import cameras

SHAPE = "BlendSwap-CC-0__108__chair_with_cushion"  # of the validation split; CC0
SIZE, SPLAT, POINTS = 420, 5, 9000
SCAN, SEEN, INFERRED, TRUTH = (60, 60, 60), (43, 108, 176), (221, 107, 32), (110, 110, 110)
LOOKS_FROM = (25.0, 20.0)  # azimuth and elevation, degrees: past the side that the camera saw
OUT = Path(__file__).with_suffix(".webp")


def panel(points: Float[np.ndarray, "n 3"], colours: np.ndarray) -> Image.Image:
    """Points of the frame v1 as small squares, the farthest first, darker the farther they are."""
    angles = np.radians(LOOKS_FROM)
    right, up, back = cameras.rotation(angles[0], angles[1])
    order = np.argsort(points @ back)
    depth = (points @ back)[order]
    shade = 0.55 + 0.45 * (depth - depth.min()) / np.ptp(depth)
    image = np.full((SIZE, SIZE, 3), 255, np.uint8)
    for x, y, colour in zip(points[order] @ right, points[order] @ up, shade[:, None] * colours[order], strict=True):
        column, row = int(SIZE * (0.5 + x)), int(SIZE * (0.5 - y))
        image[row : row + SPLAT, column : column + SPLAT] = 255 - (255 - colour) * 0.85
    return Image.fromarray(image)


def main() -> None:
    """The scan, seen and inferred points, the truth."""
    (row,) = (row for row in manifest.of(["chair"]) if row.id == SHAPE)
    given = complete.case(row)
    scan = given.scan(0)
    found = ddf.complete(scan, "chair", given.place.to_matrix(), refine=False, n=POINTS)
    truth = given.truth.points / complete.K
    pictures = [
        panel(scan.points, np.tile(SCAN, (len(scan.points), 1))),
        panel(found.points, np.where(found.seen[:, None], SEEN, INFERRED)),
        panel(truth, np.tile(TRUTH, (len(truth), 1))),
    ]
    sheet = Image.new("RGB", (SIZE * len(pictures), SIZE), "white")
    for place, picture in enumerate(pictures):
        sheet.paste(picture, (SIZE * place, 0))
    sheet.save(OUT, quality=80)


if __name__ == "__main__":
    main()

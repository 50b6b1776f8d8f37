"""Writes docs/complete.webp: a public chair as a depth camera sees it, completed, and whole.

It needs the packages of `ddf shapes get`.
"""

import sys
from pathlib import Path

import labelled
import numpy as np
from PIL import Image

import ddf

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from bench.reconstruction import complete
from ddf.data.public import manifest
from ddf.pictures import completed_pictures

SHAPE = "BlendSwap-CC-0__108__chair_with_cushion"  # of the validation split; CC0
SIZE, POINTS, TRUTH = 420, 9000, (110, 110, 110)
LOOKS_FROM = (25.0, 20.0)  # azimuth and elevation, degrees: past the side that the camera saw
NAMES = ("the scan", "completed: seen blue,\ninferred orange", "the truth")
OUT = Path(__file__).with_suffix(".webp")


def main() -> None:
    """The scan, seen and inferred points, the truth."""
    (row,) = (row for row in manifest.of(["chair"]) if row.id == SHAPE)
    given = complete.case(row)
    scan = given.scan(0)
    found = ddf.complete(scan, "chair", given.place.to_matrix(), refine=False, n=POINTS)
    truth = given.truth.points / complete.K
    drawn = [
        (scan.points, np.tile(completed_pictures.SCAN, (len(scan.points), 1))),
        (found.points, np.where(found.seen[:, None], completed_pictures.SEEN, completed_pictures.INFERRED)),
        (truth, np.tile(TRUTH, (len(truth), 1))),
    ]
    pictures = [completed_pictures.dots(points, colours, SIZE, *LOOKS_FROM) for points, colours in drawn]
    labelled.sheet([("", NAMES, [Image.fromarray(each) for each in pictures])]).save(OUT, quality=80)


if __name__ == "__main__":
    main()

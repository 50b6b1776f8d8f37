"""Writes docs/reconstructed.webp: what the package's models make of images of shapes that they never saw.

Of each category nine test shapes, evenly spaced in the order of the manifest, whatever comes out of them. It needs the
packages of `ddf shapes get`. Its metadata hold the checksums of the models.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import ddf

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from bench.reconstruction import complete
from ddf.data.public import manifest
from ddf_lab.engine import publish

CATEGORIES, SHAPES, PER_LINE, SIDE = ("chair", "plane", "car"), 9, 3, 132
TURNS = (0.0, 110.0)  # degrees from the image's azimuth
OUT = Path(__file__).with_suffix(".webp")


def chosen(category: str) -> list[manifest.Row]:
    """Test shapes of a category."""
    rows = [row for row in manifest.of([category]) if row.split == "test"]
    return [rows[i * len(rows) // SHAPES] for i in range(SHAPES)]


def shown(row: manifest.Row, folder: Path) -> np.ndarray:
    """The image of a shape's first view, and its reconstruction in these colours, from there and from elsewhere."""
    found = ddf.reconstruct(complete.case(row).image(folder), row.category)
    return np.asarray(found.paint.sheet(SIDE, TURNS))


def main() -> None:
    """A block a category, three shapes a line."""
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        for category in CATEGORIES:
            cells = [shown(row, Path(folder)) for row in chosen(category)]
            lines += [np.concatenate(cells[i : i + PER_LINE], axis=1) for i in range(0, SHAPES, PER_LINE)]
    sheet = Image.fromarray(np.concatenate(lines))
    sheet.save(OUT, quality=85, method=6, xmp=json.dumps(publish.shipped("reconstruction")).encode())


if __name__ == "__main__":
    main()

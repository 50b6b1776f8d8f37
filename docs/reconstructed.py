"""Writes docs/reconstructed.webp: what the package's models make of images of shapes that they never saw.

Of each category up to twelve test shapes, evenly spaced in the order of the manifest, whatever comes out of them. It
needs the packages of `ddf shapes get`. Its metadata hold the checksums of the models.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import ddf

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from bench.reconstruction import complete
from ddf.data.public import manifest
from ddf.fields import framed_field
from ddf.fit import patch_fitting
from ddf.geometry.mesh_io import Mesh
from ddf.pictures import picture_strips, shaded
from ddf_lab.engine import publish

CATEGORIES, SHAPES, PER_LINE, SIDE = ("chair", "plane", "car"), 12, 3, 128
CELLS, TITLE = ("image", "reconstruction", "other side", "truth"), 30  # pixels of the line that says so
ASIDE = 110.0  # degrees from the image's azimuth
OUT = Path(__file__).with_suffix(".webp")


def chosen(category: str) -> list[manifest.Row]:
    """Test shapes of a category."""
    rows = [row for row in manifest.of([category]) if row.split == "test"]
    count = min(SHAPES, len(rows))
    return [rows[i * len(rows) // count] for i in range(count)]


def truth(given: complete.Case) -> np.ndarray:
    """A shape from the side, seen as its reconstruction is."""
    field = patch_fitting.patches(Mesh(given.shape.vertices, given.shape.triangles))
    around = (given.views[0].azimuth_deg + ASIDE, given.views[0].elevation_deg)
    camera = (*around, framed_field.framing_radius(field, *around))
    standing = shaded.stand(field)
    return shaded.render(standing, camera, SIDE, shaded.window(standing, [camera])).picture


def shown(row: manifest.Row, folder: Path) -> np.ndarray:
    """The cells of a shape: its first view, the reconstruction in these colours, and the truth."""
    given = complete.case(row)
    file = given.image(folder)
    found = ddf.reconstruct(file, row.category)
    with Image.open(file) as opened:
        image = opened.convert("RGBA")
    left, top, right, lower = image.getchannel("A").getbbox() or (0, 0, *image.size)
    half = 1.08 * max(right - left, lower - top) / 2
    x, y = (left + right) / 2, (top + lower) / 2
    cut = image.crop((round(x - half), round(y - half), round(x + half), round(y + half))).resize((SIDE, SIDE))
    seen = picture_strips.on_white(np.asarray(cut) / 255.0)
    return np.concatenate((seen, np.asarray(found.paint.sheet(SIDE, (0.0, ASIDE)))[:, SIDE:], truth(given)), axis=1)


def main() -> None:
    """A block a category, three shapes a line, and above all what the columns are."""
    title = Image.new("RGB", (PER_LINE * len(CELLS) * SIDE, TITLE), "white")
    pen, names = ImageDraw.Draw(title), PER_LINE * CELLS
    for column, name in enumerate(names):
        pen.text(((column + 0.5) * SIDE, TITLE / 2), name, fill="black", font=picture_strips.font(15), anchor="mm")
    lines = [np.asarray(title)]
    with tempfile.TemporaryDirectory() as folder:
        for category in CATEGORIES:
            cells = [shown(row, Path(folder)) for row in chosen(category)]
            cells += [np.full_like(cells[0], 255)] * (-len(cells) % PER_LINE)
            lines += [np.concatenate(cells[i : i + PER_LINE], axis=1) for i in range(0, len(cells), PER_LINE)]
    sheet = Image.fromarray(np.concatenate(lines))
    sheet.save(OUT, quality=85, method=6, xmp=json.dumps(publish.shipped("reconstruction")).encode())


if __name__ == "__main__":
    main()

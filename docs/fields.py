"""Writes docs/fields.webp, the picture of README.md: depth, normals and curvature of the networks of `ddf models`.

Its metadata hold the checksums of the fields.
"""

import io
import json
from pathlib import Path

from PIL import Image

import ddf
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.engine import publish

FIELDS = ("rabbit", "armchair", "airliner", "nested")
OUTPUTS = {"depth": "Depth", "normals": "Normals", "mean_curvature": "Mean curvature"}
SIDE = 280  # pixels of each picture
OUT = Path(__file__).with_suffix(".webp")


def main() -> None:
    """One row an output, one column a field."""
    asked = (*OUTPUTS, "visibility")
    images = [ddf.load(f"{name}-network").render(size=SIDE, outputs=asked) for name in FIELDS]
    rows = [
        picture_strips.StripRow(label, (), [field_pictures.picture(output, each) for each in images])
        for output, label in OUTPUTS.items()
    ]
    sheet = Image.open(io.BytesIO(picture_strips.strip(FIELDS, rows, len(FIELDS), SIDE)))
    sheet.save(OUT, quality=80, xmp=json.dumps(publish.shipped("field")).encode())


if __name__ == "__main__":
    main()

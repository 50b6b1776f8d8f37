"""Writes docs/fields.webp, the picture of README.md: depth, normals and curvature of the networks of `ddf models`.

Its metadata hold the checksums of the fields.
"""

import json
from pathlib import Path

import labelled
from PIL import Image

import ddf
from ddf.pictures import field_pictures
from ddf_lab.engine import publish

FIELDS = tuple(f"{name}-network" for name in ("rabbit", "armchair", "airliner", "nested"))
OUTPUTS = {  # each picture has its own scale
    "depth": "Depth: yellow near, violet far, 1st to 99th percentile of each",
    "normals": "Normals: red, green and blue are X, Y and Z, from -1 to 1",
    "mean_curvature": "Mean curvature: blue < 0 < red, full at each one's 95th percentile",
}
SIDE = 280  # pixels of each picture
OUT = Path(__file__).with_suffix(".webp")


def main() -> None:
    """One row an output, one column a field."""
    asked = (*OUTPUTS, "visibility")
    images = [ddf.load(name).render(size=SIDE, outputs=asked) for name in FIELDS]
    rows = [
        (label, FIELDS, [Image.fromarray(field_pictures.picture(output, each)) for each in images])
        for output, label in OUTPUTS.items()
    ]
    sheet = labelled.sheet(rows)
    sheet.save(OUT, quality=80, xmp=json.dumps(publish.shipped("field")).encode())


if __name__ == "__main__":
    main()

"""Writes docs/fields.webp, the picture of README.md: depth, normals and curvature of the fields of `ddf models`.

Its metadata hold the checksums of the fields.
"""

import json
import tempfile
from pathlib import Path

from PIL import Image

from ddf import cli
from ddf_lab.engine import publish

FIELDS = ("rabbit", "armchair", "airliner", "nested")
OUTPUTS = ("depth", "normals", "mean_curvature")
SIZE = 280  # pixels of each picture a side
OUT = Path(__file__).with_suffix(".webp")


def main() -> None:
    """One row an output, one column a field."""
    sheet = Image.new("RGB", (SIZE * len(FIELDS), SIZE * len(OUTPUTS)), "white")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "field.png"
        for row, output in enumerate(OUTPUTS):
            for column, name in enumerate(FIELDS):
                cli.main(["render", name, str(file), "--output", output, "--size", str(SIZE)])
                sheet.paste(Image.open(file).convert("RGB"), (SIZE * column, SIZE * row))
    sheet.save(OUT, quality=80, xmp=json.dumps(publish.shipped("field")).encode())


if __name__ == "__main__":
    main()

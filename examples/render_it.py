"""Draw a field that comes with the package: normals as light and shade, in a PNG file.

python examples/render_it.py rabbit rabbit.png --size 256
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

import ddf

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("field", help="a name that `ddf models` lists, or the folder of a field")
    parser.add_argument("out", help="a .png file")
    parser.add_argument("--size", type=int, default=256, help="pixels a side")
    args = parser.parse_args()

    try:
        Path(args.out).parent.resolve(strict=True)  # before the work
        field = ddf.load(args.field)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    pictures = field.render(azimuth_deg=35, elevation_deg=25, size=args.size, outputs=("visibility", "normals"))
    light = np.array([0.6, 0.7, 0.4]) / np.linalg.norm([0.6, 0.7, 0.4])
    shade = 0.25 + 0.75 * np.clip(pictures["normals"] @ light, 0, 1)
    picture = np.where(pictures["visibility"] >= 0.5, shade, 1.0)  # a white background
    Image.fromarray((255 * picture).astype(np.uint8)).save(args.out)

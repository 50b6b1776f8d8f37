"""Put two fields into one scene and draw its depth: near is bright, nothing is black.

python examples/compose_two.py scene.png --size 256
"""

import argparse

import numpy as np
from PIL import Image

import ddf

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", help="a .png file")
    parser.add_argument("--size", type=int, default=256, help="pixels a side")
    args = parser.parse_args()

    beside = np.eye(4)  # from the frame of the armchair to that of the scene
    beside[0, 3] = 1.5
    scene = ddf.compose([ddf.load("rabbit"), ddf.load("armchair")], [np.eye(4), beside])

    depth = scene.render(azimuth_deg=35, elevation_deg=25, size=args.size, outputs=("depth",))["depth"]
    seen = np.isfinite(depth)
    near, far = depth[seen].min(), depth[seen].max()
    picture = np.where(seen, 255 - 200 * (depth - near) / (far - near), 0)
    Image.fromarray(picture.astype(np.uint8)).save(args.out)
    print(f"depth from {near:.2f} to {far:.2f}, in the unit of the meshes")

"""From one RGBA image to a cloud of points and the camera, by a model that comes with the package.

python examples/reconstruct_an_image.py chair.npz --points 5000
"""

import argparse
from pathlib import Path

import numpy as np

import ddf

SAMPLE = Path(ddf.__file__).parent / "shipped" / "chair" / "sample_0.png"

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", help="a .npz file")
    parser.add_argument("--image", default=SAMPLE, help="its alpha is the mask of the object")
    parser.add_argument("--model", default="chair", help="chair, plane or car, or a folder of a training")
    parser.add_argument("--points", type=int, default=5000)
    args = parser.parse_args()

    try:
        Path(args.out).parent.resolve(strict=True)  # before the work
        found = ddf.reconstruct(args.image, args.model, n=args.points)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    np.savez(args.out, points=found.points)
    print(f"{len(found.points)} points from {found.points.min(axis=0).round(2)} to {found.points.max(axis=0).round(2)}")
    print("camera: " + ", ".join(f"{name} {value:.2f}" for name, value in found.camera.items()))

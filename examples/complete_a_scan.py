"""Complete a chair that a lidar saw from one side, and tell what was seen from what is inferred.

python examples/complete_a_scan.py --beams 32
"""

import argparse

import numpy as np

import ddf
from ddf.core import shipped_models

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scan", help="NPZ file of your own; without it a chair is scanned")
    parser.add_argument("--beams", type=int, default=32, help="of that lidar")
    args = parser.parse_args()

    scan = args.scan
    if scan is None:
        chair = ddf.reconstruct(shipped_models.ROOT / "chair" / "sample_0.png", "chair").field
        scan = ddf.lidar(chair, beams=args.beams, columns=720, noise=0.003)
    try:
        found = ddf.complete(scan, "chair", noise=0.003)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    found.save("whole_chair")  # ddf render whole_chair chair.png; ddf surface whole_chair chair.ply
    for name, part in (("seen", found.seen), ("inferred", ~found.seen)):
        print(f"{name}: {part.mean():.0%}, the surface within {np.nanmedian(found.spread[part]):.4f}")
    print(f"explained: {found.explained:.0%} of the hits; middle at {np.round(found.pose[:3, 3], 3)}")

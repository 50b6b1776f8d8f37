"""Recover where an object stands from one depth image, by gradient descent through its field.

python examples/recover_pose.py --turn 12 --shift 0.1
"""

import argparse

import numpy as np

import ddf

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--field", default="rabbit", help="a field that comes with the package, or a folder")
    parser.add_argument("--turn", type=float, default=12.0, help="degrees that the start is turned by, about Y")
    parser.add_argument("--shift", type=float, default=0.1, help="how far it is moved along X")
    args = parser.parse_args()

    try:
        field = ddf.load(args.field)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    scan = ddf.depth_camera(field, size=32)  # in its place may stand what a depth camera gave
    cosine, sine = np.cos(np.radians(args.turn)), np.sin(np.radians(args.turn))
    start = np.array([[cosine, 0, sine, args.shift], [0, 1, 0, 0], [-sine, 0, cosine, 0], [0, 0, 0, 1]])
    found = ddf.recover_pose(field, scan, start)
    angle = np.degrees(np.arccos(np.clip((np.trace(found[:3, :3]) - 1) / 2, -1, 1)))
    print(f"turned by {angle:.2f} degrees and moved by {np.linalg.norm(found[:3, 3]):.4f} from the true pose")

"""Recover where an object stands from one depth image, by gradient descent through its field.

python examples/recover_pose.py --turn 12 --shift 0.1
"""

import argparse

import numpy as np
import torch

from ddf.core import shipped_models
from ddf.fields.scenes import pose
from ddf.fit import shape_field

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--field", default="rabbit", help="a field that comes with the package, or a folder")
    parser.add_argument("--turn", type=float, default=12.0, help="degrees that the true pose is turned by")
    parser.add_argument("--shift", type=float, default=0.1, help="how far it is moved, in units of the field")
    parser.add_argument("--steps", type=int, default=150)
    args = parser.parse_args()

    field = shape_field.load(shipped_models.place(args.field))
    axis = torch.tensor([0.3, 1.0, -0.2])
    true = pose.Pose(np.radians(args.turn) * axis / axis.norm(), args.shift * torch.tensor([0.6, -0.4, 0.7]))
    view = pose.image_rays(size=32)
    image = pose.render(field, true, view)  # in its place may stand what a depth camera gave
    found = pose.recover(field, image, view, args.steps)
    angle, shift = pose.difference(found, true)
    print(f"turned by {angle:.2f} degrees and moved by {shift:.4f} from the true pose")

"""The pose of a known object from one depth image: `ddf.recover_pose` beside ICP from the same start on the same rays.

Fields that come with the package, seen by 64 x 64 pixels of themselves. A start is off by an angle about a random axis,
by 10 % of the size, and by a twentieth of the box's longest side in place. Solved: to 2 degrees and 2 % of the size.
ICP lays 2,000 points of the field over 300 hits in 10 steps, trimmed, with a scale. Seconds are processor time of
one thread.
"""

import argparse
import time
from collections.abc import Sequence

import numpy as np
import torch

import ddf
from bench.lib import measuring
from bench.reconstruction import complete
from ddf.geometry import transforms

ON_DEMAND = "python -m bench pose"
FIELDS, ANGLES = ("rabbit", "armchair"), (15.0, 30.0, 60.0, 90.0)
SOLVED_DEG, SOLVED_PERCENT = 2.0, 2.0


def main(arguments: Sequence[str]) -> None:
    """Measure all angles and both ways."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=4, help="of each field and angle (default %(default)s)")
    starts = parser.parse_args(arguments).starts
    torch.set_num_threads(1)
    found: dict[tuple[str, float], list[tuple[float, float, float]]] = {}
    for name in FIELDS:
        field = ddf.load(name)
        lower, upper = (np.asarray(corner) for corner in field.box)
        box = transforms.Similarity(float((upper - lower).max()) / 2, np.eye(3), (lower + upper) / 2)
        scan, cloud = ddf.depth_camera(field, size=complete.PIXELS), field.points(complete.ICP_POINTS)
        hits = scan.points[np.random.default_rng(0).permutation(scan.hit.sum())[: complete.ICP_HITS]]
        for angle in ANGLES:
            for number in range(starts):
                start = complete.off(box, np.random.default_rng(number), angle).compose(box.inverse())
                began = time.process_time()
                ours = ddf.recover_pose(field, scan, start.to_matrix(), resize=True)
                between = time.process_time()
                laid, _ = complete.align(start.apply(cloud), hits)
                ended = time.process_time()
                by_icp = complete.similar(cloud, laid)
                for way, pose, spent in (
                    ("field", transforms.Similarity.of_matrix("pose", ours), between - began),
                    ("ICP", by_icp, ended - between),
                ):
                    off = complete.pose_error(pose, transforms.Similarity())
                    found.setdefault((way, angle), []).append((*off, spent))
        print(name, {key: np.median(values, axis=0).round(2).tolist() for key, values in found.items()}, flush=True)
    rows = []
    for (way, angle), values in found.items():
        turned, grown, seconds = np.array(values).T
        solved = 100 * float(np.mean((turned <= SOLVED_DEG) & (grown <= SOLVED_PERCENT)))
        error = {
            "solved_percent": solved,
            "angle_deg": float(np.median(turned)),
            "scale_percent": float(np.median(grown)),
        }
        rows.append(measuring.row(f"{way}, off by {angle:g} degrees", {"starts": len(values)}, seconds.tolist(), error))
    measuring.write("pose", 1, rows)

"""The pose of a known object from one depth image: `ddf.recover_pose` beside ICP from the same start on the same rays.

Fields that come with the package, seen by 64 x 64 pixels of themselves. A start is off by an angle about a random axis,
by 10 % of the size, and by a twentieth of the box's longest side in place. Solved: to 2 degrees and 2 % of the size.
ICP lays 2,000 points of the field over 300 hits in 10 steps, trimmed, with a scale. `wall`: 64 rabbits, each turned
its own way, in one image of 400 x 400, their starts off by 30 degrees: some asked for alone, then all in one call.
Seconds are processor time of one thread, of an object.
"""

import argparse
import time
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import torch

import ddf
from bench.lib import measuring
from bench.reconstruction import complete
from ddf.geometry import sensors, transforms

ON_DEMAND = "python -m bench pose"
FIELDS, ANGLES = ("rabbit", "armchair"), (15.0, 30.0, 60.0, 90.0)
SOLVED_DEG, SOLVED_PERCENT = 2.0, 2.0
SIDE, WALL_PIXELS, WALL_DEG, APART, ALONE = 8, 400, 30.0, 1.5, 4  # times the longest side; objects asked for alone


def boxed(field: ddf.Field) -> transforms.Similarity:
    """The cube of a field's box."""
    lower, upper = (np.asarray(corner) for corner in field.box)
    return transforms.Similarity(float((upper - lower).max()) / 2, np.eye(3), (lower + upper) / 2)


def wall(field: ddf.Field) -> tuple[sensors.Sweep, list[transforms.Similarity]]:
    """What a camera sees of a wall of objects, and where these stand."""
    box, random = boxed(field), np.random.default_rng(0)
    step, middle = 2 * APART * box.scale, (SIDE - 1) / 2
    places = []
    for row, column in np.ndindex(SIDE, SIDE):
        turned = complete.off(box, random, float(random.uniform(0, 180)))
        at = step * np.array([column - middle, row - middle, 0.0])
        places.append(transforms.Similarity(box.scale, turned.rotation, at).compose(box.inverse()))
    camera = transforms.Similarity(1.0, sensors.CAMERA, np.array([0.0, 0.0, SIDE * step])).to_matrix()
    scene = ddf.compose([field] * len(places), [place.to_matrix() for place in places])
    lens = [[WALL_PIXELS * 0.95, 0, WALL_PIXELS / 2], [0, WALL_PIXELS * 0.95, WALL_PIXELS / 2], [0, 0, 1]]
    return ddf.depth_camera(scene, camera, size=WALL_PIXELS, intrinsics=lens), places


def crowd() -> list[dict[str, Any]]:
    """Rows of the wall."""
    field = ddf.load(FIELDS[0])
    scan, places = wall(field)
    starts = [
        place.compose(complete.off(boxed(field), np.random.default_rng(number), WALL_DEG)).compose(
            boxed(field).inverse()
        )
        for number, place in enumerate(places)
    ]
    matrices, rows = np.stack([start.to_matrix() for start in starts]), []
    for calls in ([matrices[[index]] for index in range(ALONE)], [matrices]):
        found, seconds = [], []
        for asked in calls:
            began = time.process_time()
            found += list(ddf.recover_pose(field, scan, asked, resize=True))
            seconds.append((time.process_time() - began) / len(asked))
        poses = [transforms.Similarity.of_matrix("pose", pose) for pose in found]
        errors = (complete.pose_error(pose, place) for pose, place in zip(poses, places, strict=False))
        rows.append(row(f"field, wall, {len(calls[0])} at once", seconds, errors))
    return rows


def row(what: str, seconds: Sequence[float], errors: Iterable[tuple[float, float]]) -> dict[str, Any]:
    """Share solved, and medians."""
    turned, grown = np.array(list(errors)).T
    solved = 100 * float(np.mean((turned <= SOLVED_DEG) & (grown <= SOLVED_PERCENT)))
    error = {
        "solved_percent": solved,
        "angle_deg": float(np.median(turned)),
        "scale_percent": float(np.median(grown)),
    }
    return measuring.row(what, {"starts": len(turned)}, seconds, error)


def main(arguments: Sequence[str]) -> None:
    """Measure all angles and both ways, then the wall; what is there is written before."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=4, help="of each field and angle (default %(default)s)")
    starts = parser.parse_args(arguments).starts
    torch.set_num_threads(1)
    found: dict[tuple[str, float], list[tuple[float, float, float]]] = {}
    for name in FIELDS:
        field = ddf.load(name)
        box = boxed(field)
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
    rows = [
        row(f"{way}, off by {angle:g} degrees", [each[2] for each in values], [each[:2] for each in values])
        for (way, angle), values in found.items()
    ]
    measuring.write("pose", 1, rows)
    measuring.write("pose", 1, [*rows, *crowd()])

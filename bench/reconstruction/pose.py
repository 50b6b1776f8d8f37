"""The pose of a known object from one depth image: `ddf.recover_pose` beside ICP from the same start on the same rays.

Fields that come with the package, seen by 64 x 64 pixels of themselves. A start is off by an angle about a random axis,
by 10 % of the size, and by a twentieth of the box's longest side in place. Solved: to 2 degrees and 2 % of the size.
ICP is Open3D's, point to point with a scale: all hits against 20,000 points of the field, and less and less far from
them, which solved most of what was tried. It has converged at every distance.
Seconds are processor time of one thread, of an object.
"""

import time
from collections.abc import Iterable, Sequence

import numpy as np
import open3d as o3d
from jaxtyping import Float

import ddf
from bench.lib import measuring
from bench.reconstruction import complete
from ddf.geometry import transforms

FIELDS, ANGLES = ("rabbit-network", "armchair-network"), (15.0, 30.0, 60.0, 90.0)
SOLVED_DEG, SOLVED_PERCENT = 2.0, 2.0
ICP_POINTS, ICP_STEPS, ICP_CONVERGED = 20_000, 500, 1e-9  # steps at most
ICP_REACH = (0.5, 0.2, 0.1, 0.05, 0.02)  # of the box's longest side: pairs are nearer


def icp(
    cloud: Float[np.ndarray, "n 3"], hits: Float[np.ndarray, "m 3"], start: transforms.Similarity, side: float
) -> transforms.Similarity:
    """The pose of a cloud from hits of it."""
    method = o3d.pipelines.registration
    source, target = (o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)) for points in (hits, cloud))
    found = start.inverse().to_matrix()
    similar = method.TransformationEstimationPointToPoint(with_scaling=True)
    ends = method.ICPConvergenceCriteria(ICP_CONVERGED, ICP_CONVERGED, ICP_STEPS)
    for reach in ICP_REACH:
        found = method.registration_icp(source, target, reach * side, found, similar, ends).transformation
    return transforms.Similarity.of_matrix("ICP", found).inverse()


def boxed(field: ddf.Field) -> transforms.Similarity:
    """The cube of a field's box."""
    lower, upper = (np.asarray(corner) for corner in field.box)
    return transforms.Similarity(float((upper - lower).max()) / 2, np.eye(3), (lower + upper) / 2)


def row(what: str, seconds: Sequence[float], errors: Iterable[tuple[float, float]]) -> measuring.Row:
    """Share solved, and medians."""
    turned, grown = np.array(list(errors)).T
    solved = 100 * float(np.mean((turned <= SOLVED_DEG) & (grown <= SOLVED_PERCENT)))
    error = {
        "solved_percent": solved,
        "angle_deg": float(np.median(turned)),
        "scale_percent": float(np.median(grown)),
    }
    return measuring.row(what, {"starts": len(turned)}, seconds, error)


def main(*, starts: int = 4) -> measuring.Rows:
    """Both ways from all angles.

    Args:
      starts: of each field and angle.
    """
    fields = {name: ddf.load(name) for name in FIELDS}
    for angle in ANGLES:
        found: dict[str, list[tuple[float, float, float]]] = {"field": [], "ICP": []}
        for field in fields.values():
            scan, cloud, box = ddf.depth_camera(field, size=complete.PIXELS), field.points(ICP_POINTS), boxed(field)
            for number in range(starts):
                start = complete.off(box, np.random.default_rng(number), angle).compose(box.inverse())
                began = time.process_time()
                ours = ddf.recover_pose(field, scan, start.to_matrix(), resize=True)
                between = time.process_time()
                theirs = icp(cloud, scan.points, start, 2 * box.scale)
                ended = time.process_time()
                poses = {"field": transforms.Similarity.of_matrix("pose", ours), "ICP": theirs}
                for (way, own), spent in zip(poses.items(), (between - began, ended - between), strict=True):
                    found[way].append((*complete.pose_error(own, transforms.Similarity()), spent))
        for way, values in found.items():
            yield row(f"{way}, off by {angle:g} degrees", [each[2] for each in values], [each[:2] for each in values])

"""What pinhole cameras around a sphere measure, by its closed form."""

import numpy as np

from ddf.geometry import rays, scans

RADIUS, AWAY, SIDE = 0.5, 2.0, 60


def sphere_scan(views: int, noise: float = 0.0, outliers: float = 0.0) -> scans.Scan:
    """Of a sphere about the origin, by pinhole cameras around it; noise: of its ranges."""
    focal = SIDE / 2 / 0.3
    along = scans.pixel_directions(SIDE, SIDE, [[focal, 0, SIDE / 2], [0, focal, SIDE / 2], [0, 0, 1]])
    positions, directions = [], []
    for eye in rays.evenly_spread(views):
        turn, _ = np.linalg.qr(np.stack([-eye, [0.3, 0.5, 0.1], [0.2, -0.4, 0.7]], axis=1))
        turn[:, 0] *= np.sign(turn[:, 0] @ -eye)
        positions.append(np.broadcast_to(AWAY * eye, along.shape))
        directions.append(along @ turn[:, [1, 2, 0]].T)
    p, v = np.concatenate(positions), np.concatenate(directions)
    middle = -(p * v).sum(axis=1)
    left = RADIUS**2 - ((p + middle[:, None] * v) ** 2).sum(axis=1)
    truth = np.where(left > 0, middle - np.sqrt(np.maximum(left, 0)), np.inf)
    random = np.random.default_rng(3)
    ranges = truth + noise * random.standard_normal(len(truth))
    stray = random.random(len(truth)) < outliers
    return scans.Scan(p, v, np.where(stray, 2 * truth * random.uniform(0.01, 1, len(truth)), ranges))

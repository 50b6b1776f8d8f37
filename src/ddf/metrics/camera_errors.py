"""Errors of predicted cameras and of the scale that goes with them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


def angle_difference_deg(
    angle_rad: Float[np.ndarray, " n"], truth_rad: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Smallest |difference| of two azimuths in degrees, in [0, 180]: they wrap round."""
    difference = np.asarray(angle_rad, dtype=np.float64) - np.asarray(truth_rad, dtype=np.float64)
    return np.degrees(np.abs((difference + np.pi) % (2 * np.pi) - np.pi))


@dataclass(frozen=True)
class CameraError:
    """An error of a camera; tables have its median.

    compute: from predicted and true cameras (n, 3), azimuth and elevation in radians, radius in benchmark units, and
    from the ratio of predicted to true scale (n). label, digits: in reports.
    """

    compute: Callable[[np.ndarray, np.ndarray, np.ndarray], Float[np.ndarray, " n"]]
    label: str
    digits: int


ERRORS = {
    "azimuth_error_deg": CameraError(
        lambda guess, truth, _: angle_difference_deg(guess[:, 0], truth[:, 0]), "azimuth, degrees", 1
    ),
    "elevation_error_deg": CameraError(
        lambda guess, truth, _: np.degrees(np.abs(guess[:, 1] - truth[:, 1])), "elevation, degrees", 2
    ),
    "radius_error": CameraError(
        lambda guess, truth, _: np.abs(guess[:, 2] - truth[:, 2]), "radius, benchmark units", 3
    ),
    "scale_error_percent": CameraError(lambda _, __, ratio: 100.0 * np.abs(ratio - 1.0), "scale, %", 1),
}

"""Cameras that look at a scene: one, those of an orbit, those of a flight along waypoints. [DDF22] fig. `simpleroom`.

A camera has a position and looks at a target; its lens is that of `cameras`. Everything is in the frame of the scene.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ddf.core import checks
from ddf.fields import framed_field
from ddf.geometry import cameras

UP = {"y": np.array([0.0, 1.0, 0.0]), "z": np.array([0.0, 0.0, 1.0])}
_UPRIGHT = 1e-6  # |up x way| below this: the camera looks straight up or down


@dataclass(frozen=True)
class LookAt:
    """A camera at `position` that looks at `target`.

    Raises:
      InputError: the two coincide, or a number is not finite.
    """

    position: Float[np.ndarray, "3"]
    target: Float[np.ndarray, "3"]

    def __post_init__(self) -> None:
        checks.require_finite("a camera", np.stack([self.position, self.target]))
        if not np.linalg.norm(self.target - self.position) > 0:
            raise checks.InputError(f"a camera must look away from where it stands; got {self.position.tolist()} twice")

    def rays(self, size: int, up: str = "y") -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Starts and unit directions through the pixel centres of a picture, rows from the top."""
        backwards = self.position - self.target
        backwards = backwards / np.linalg.norm(backwards)
        right = np.cross(UP[up], backwards)
        if np.linalg.norm(right) < _UPRIGHT:
            right = np.cross(np.roll(UP[up], 1), backwards)
        right = right / np.linalg.norm(right)
        rows = np.stack([right, np.cross(backwards, right), backwards])
        directions = cameras.pixel_directions(size, np.zeros(0)).reshape(-1, 3) @ rows
        return np.broadcast_to(self.position, directions.shape).copy(), directions


def one(field: framed_field.FramedField, azimuth_deg: float, elevation_deg: float, radius: float, up: str) -> LookAt:
    """The camera of `framed_field.camera_rays`, of a field whose frame is the scene's."""
    starts, _ = framed_field.camera_rays(field, (azimuth_deg, elevation_deg, radius), 1, up)
    return LookAt(starts[0], (field.lower + field.upper) / 2)


def orbit(
    field: framed_field.FramedField,
    azimuth_deg: float,
    elevation_deg: float,
    radius: float | None,
    frames: int,
    up: str,
) -> list[LookAt]:
    """Once around the box, evenly; without a radius the box stays within every picture."""
    turns = [azimuth_deg + 360.0 * i / frames for i in range(frames)]
    if radius is None:
        radius = max(framed_field.framing_radius(field, turn, elevation_deg, up) for turn in turns)
    return [one(field, turn, elevation_deg, radius, up) for turn in turns]


def fly(waypoints: Sequence[LookAt], frames: int) -> list[LookAt]:
    """Along the waypoints, positions and targets linear between two, as many frames between every two.

    Raises:
      InputError: fewer than two waypoints, or a camera on the way that looks at where it stands.
    """
    if len(waypoints) < 2:
        raise checks.InputError(f"a flight needs two waypoints or more; got {len(waypoints)}")
    stops = np.arange(len(waypoints))
    places = np.linspace(0, len(waypoints) - 1, frames)
    parts = [np.stack([getattr(w, name) for w in waypoints]) for name in ("position", "target")]
    positions, targets = (np.stack([np.interp(places, stops, column) for column in part.T], axis=-1) for part in parts)
    return [LookAt(position, target) for position, target in zip(positions, targets, strict=True)]


def straight_in(field: framed_field.FramedField, start: LookAt) -> list[LookAt]:
    """Two waypoints: from a camera to the middle of the box, looking ahead all the way."""
    middle = (field.lower + field.upper) / 2
    ahead = middle + (middle - start.position) / 2
    return [LookAt(start.position, ahead), LookAt(middle, ahead)]

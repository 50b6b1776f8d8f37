"""Procedural textures: a second colour, mixed in by a smooth function of the place in the shape's own frame.

All patterns are soft-edged, about a pixel wide in a render, so that one sample a pixel shows them without jags.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

TURN = np.float32(2 * np.pi)

Phases = Float32[np.ndarray, "n 3"]
Shares = Float32[np.ndarray, "n"]


@dataclass(frozen=True)
class Texture:
    """A pattern of a second colour.

    kind: of `KINDS`. colour: the second one, linear, in [0, 1]. axes: rows that take a place in the v1 frame to the
    pattern's three coordinates, in periods. shift: added to them.
    """

    kind: str
    colour: tuple[float, float, float]
    axes: tuple[tuple[float, float, float], ...]
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def shares(self, places: Float32[np.ndarray, "n 3"]) -> Shares:
        """How much of the second colour there is at each place of the v1 frame, in [0, 1]."""
        axes, shift = np.array(self.axes, dtype=np.float32), np.array(self.shift, dtype=np.float32)
        return KINDS[self.kind](places @ axes.T + shift)


def _stripes(q: Phases) -> Shares:
    return np.clip(0.5 + 2 * np.sin(TURN * q[:, 0]), 0, 1)


def _checks(q: Phases) -> Shares:
    return np.clip(0.5 + 2 * np.sin(TURN * q[:, 0]) * np.sin(TURN * q[:, 2]), 0, 1)


def _wood(q: Phases) -> Shares:
    """Growth rings, bent: dense lines along the axis in which the coordinates change slowly."""
    bent = q[:, 0] + 0.5 * np.sin(TURN * (0.23 * q[:, 1] + 0.37 * q[:, 2])) + 0.3 * np.sin(TURN * 0.31 * q[:, 1])
    return (0.5 + 0.5 * np.sin(TURN * bent)) ** 2


def _mottled(q: Phases) -> Shares:
    """Patches without a direction, as of worn cloth or camouflage."""
    a, b, c = (q[:, k] + 0.5 * np.sin(TURN * (0.7 * q[:, (k + 1) % 3] + 0.13 * k)) for k in range(3))
    return np.clip(0.5 + 0.6 * (np.sin(TURN * a) + np.sin(TURN * b) * np.sin(TURN * c)), 0, 1)


def _panels(q: Phases) -> Shares:
    """Seams: lines a twentieth of a period wide, across the first and the second axis."""
    apart = 0.5 - np.abs(q[:, :2] - np.floor(q[:, :2]) - 0.5)
    return np.clip(1.5 - apart.min(axis=1) / 0.02, 0, 1)


def _two_tone(q: Phases) -> Shares:
    """The second colour where the first coordinate is positive."""
    return np.clip(0.5 + 50 * q[:, 0], 0, 1)


def _band(q: Phases) -> Shares:
    """One stripe, where the first coordinate is between -1/2 and 1/2."""
    return np.clip(4 * (0.5 - np.abs(q[:, 0])) + 0.5, 0, 1)


# A new pattern is an entry here and a function above.
KINDS: dict[str, Callable[[Phases], Shares]] = {
    "stripes": _stripes,
    "checks": _checks,
    "wood": _wood,
    "mottled": _mottled,
    "panels": _panels,
    "two_tone": _two_tone,
    "band": _band,
}

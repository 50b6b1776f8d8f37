"""Paints of the synthetic shapes: colours, gloss, and textures.

A texture mixes in a second colour by a smooth function of the place in the shape's own frame. All patterns are
soft-edged, about a pixel wide in a render, so that one sample a pixel shows them without jags.
"""

import colorsys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int

Real = float | int
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


@dataclass(frozen=True, eq=False)
class Picture:
    """An image to lay on a shape: linear RGB in [0, 1], rows from the top; each level has half the size of the last."""

    levels: tuple[Float32[np.ndarray, "_ _ 3"], ...]

    @classmethod
    def of(cls, pixels: Float32[np.ndarray, "h w 3"]) -> "Picture":
        """All levels of an image, by means of two times two pixels, down to a side of one."""
        levels = [pixels]
        while min(pixels.shape[:2]) > 1:
            height, width = (side // 2 for side in pixels.shape[:2])
            pixels = pixels[: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
            levels.append(pixels)
        return cls(tuple(levels))

    def colours(self, places: Float32[np.ndarray, "n 2"], level: Int[np.ndarray, "n"]) -> Float32[np.ndarray, "n 3"]:
        """The nearest pixels of a level at places (u right, v up), the image repeated in both directions."""
        found = np.zeros((len(places), 3), dtype=np.float32)
        inside = places - np.floor(places)
        for number, pixels in enumerate(self.levels):
            rows = np.flatnonzero(np.clip(level, 0, len(self.levels) - 1) == number)
            height, width, _ = pixels.shape
            column = np.minimum((inside[rows, 0] * width).astype(int), width - 1)
            found[rows] = pixels[np.minimum(((1 - inside[rows, 1]) * height).astype(int), height - 1), column]
        return found


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


@dataclass(frozen=True)
class Paint:
    """Surface look: diffuse colour in [0, 1], strength and power of the highlight, a second colour's pattern."""

    colour: tuple[Real, Real, Real]
    gloss: Real = 0.0
    hardness: Real = 32.0
    texture: Texture | None = None


BLACK = Paint((0.06, 0.06, 0.065), 0.2)
GLASS = Paint((0.10, 0.13, 0.17), 0.9)
TYRE = Paint((0.045, 0.045, 0.05), 0.05)
CHROME = Paint((0.62, 0.63, 0.65), 0.9)
LAMP = Paint((0.92, 0.92, 0.85), 0.8)
TAIL_LAMP = Paint((0.62, 0.04, 0.04), 0.6)


def hsv(hue: Real, saturation: Real, value: Real, gloss: Real = 0.0) -> Paint:
    """A paint from hue, saturation and value, each in [0, 1]."""
    red, green, blue = colorsys.hsv_to_rgb(hue % 1.0, saturation, value)
    return Paint((red, green, blue), gloss)


def wood(rng: np.random.Generator) -> Paint:
    """Pine to walnut."""
    return hsv(rng.uniform(0.055, 0.105), rng.uniform(0.35, 0.75), rng.uniform(0.25, 0.8), 0.25)


def metal(rng: np.random.Generator) -> Paint:
    """Steel, chrome or black iron."""
    return hsv(0.6, 0.04, float(rng.choice([0.15, 0.45, 0.6, 0.7])), 0.8)


def cloth(rng: np.random.Generator) -> Paint:
    """Any fabric or plastic, greys and muted colours more often than bright ones."""
    if rng.random() < 0.35:
        return hsv(0.1, rng.uniform(0.0, 0.12), rng.uniform(0.12, 0.9), 0.1)
    return hsv(rng.random(), rng.uniform(0.25, 0.85), rng.uniform(0.25, 0.85), 0.15)


def chair(rng: np.random.Generator, *, is_metal: bool) -> tuple[Paint, Paint]:
    """Frame and seat of a chair; the seat of a wooden one is often wood too."""
    if is_metal or rng.random() < 0.2:
        return metal(rng), cloth(rng)
    frame = wood(rng) if rng.random() < 0.8 else cloth(rng)
    return frame, frame if rng.random() < 0.45 else cloth(rng)


def car(rng: np.random.Generator) -> Paint:
    """Body paint: white, silver, black, or a colour."""
    if rng.random() < 0.45:
        return hsv(0.6, rng.uniform(0.0, 0.05), float(rng.choice([0.12, 0.35, 0.6, 0.9])), 0.8)
    return hsv(
        rng.choice([0.0, 0.02, 0.08, 0.13, 0.33, 0.55, 0.6, 0.64]), rng.uniform(0.6, 0.95), rng.uniform(0.35, 0.85), 0.8
    )


def plane(rng: np.random.Generator) -> tuple[Paint, Paint]:
    """Fuselage and accent of an aeroplane."""
    body = hsv(0.6, rng.uniform(0.0, 0.08), rng.uniform(0.62, 0.95), 0.4)
    if rng.random() < 0.3:
        body = hsv(rng.choice([0.0, 0.12, 0.25, 0.3, 0.58]), rng.uniform(0.15, 0.7), rng.uniform(0.3, 0.8), 0.3)
    return body, hsv(rng.random(), rng.uniform(0.4, 0.9), rng.uniform(0.3, 0.85), 0.4)

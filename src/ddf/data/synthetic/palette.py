"""Colours of the synthetic shapes."""

import colorsys

import numpy as np

from ddf.data.synthetic.parts import Paint, Real

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

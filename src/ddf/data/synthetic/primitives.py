"""The smoke category `primitives`: spheres, boxes, cylinders and tori of varied proportions."""

import numpy as np

from ddf.data.synthetic import palette, parts
from ddf.data.synthetic.parts import Part


def build(rng: np.random.Generator) -> list[Part]:
    """One ellipsoid, box, cylinder or torus."""
    paint = palette.cloth(rng)
    kind = rng.choice(["sphere", "box", "cylinder", "torus"])
    stretch = dict(zip("xyz", rng.uniform(0.6, 1.4, size=3), strict=True))
    if kind == "box":
        return [parts.box((0, 0, 0), tuple(stretch.values()), paint, name="box")]
    if kind == "torus":
        angle = np.arange(36) * (2 * np.pi / 36)
        path = np.stack([np.cos(angle), np.zeros(36), -np.sin(angle)], axis=1)
        shape = parts.tube(path, rng.uniform(0.2, 0.5), paint, sides=16, closed=True, name="torus")
    elif kind == "sphere":
        polar = np.linspace(-np.pi / 2, np.pi / 2, 17)
        profile = list(zip(np.abs(np.cos(polar)).round(12), np.sin(polar), strict=True))
        shape = parts.lathe(profile, paint, sides=28, name="sphere")
    else:
        shape = parts.lathe(parts.disc_profile(0.6, rng.uniform(0.3, 1.0)), paint, sides=32, name="cylinder")
    return [shape.scaled(**stretch)]

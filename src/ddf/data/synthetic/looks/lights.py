"""Light on a surface: the two hemispherical lamps of the 3D-R2N2 renders, or a key light with a shadow.

The lamps of the renders stand on both sides of a shape, 45 degrees up, and never move: toward (0, 1, 1) and (0, 1, -1),
Y up. Each gives e (1 + n·l)/2 of its light, so both together give e (1 + n_y/√2): tops are bright, sides alike, no
shadow is cast. A key light moves with the camera, so that it says nothing about the shape's own heading.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32

LAMPS = np.array([[0, 1, 1], [0, 1, -1]], dtype=np.float32) / np.float32(np.sqrt(2))
LAMP_SHARE = 0.6  # of the views: lit as the renders are
SHADE = np.float32(0.1)  # of the key light, where it is in shadow

Vectors = Float32[np.ndarray, "n 3"]
Numbers = Float32[np.ndarray, "n"]
# Whether points of the given indices, whose normals face the light, are hidden from a light in the direction.
Occluded = Callable[[np.ndarray, Float32[np.ndarray, "3"]], Bool[np.ndarray, "k"]]


@dataclass(frozen=True)
class Light:
    """What falls on a shape in one view.

    lamps: e of the hemispherical lamps; 0.7 in the renders. key: strength of the key light; 0 casts no shadow rays.
    turn_deg, height_deg: the key light's azimuth from the camera's, and elevation. sky: light from everywhere. above:
    how much brighter it is from there than from the side. front: light from the camera. gamma: of the picture.
    """

    lamps: float = 0.0
    key: float = 0.54
    turn_deg: float = 40.0
    height_deg: float = 55.0
    sky: float = 0.25
    above: float = 0.11
    front: float = 0.13
    gamma: float = 1.35


STUDIO = Light()  # one key light, as good as any


def draw(rng: np.random.Generator, turn_deg: float, height_deg: float) -> Light:
    """The light of one view: mostly the lamps of the renders, else a key light of any strength."""
    gamma = float(rng.uniform(1.6, 2.2))
    if rng.random() < LAMP_SHARE:
        return Light(lamps=float(rng.uniform(0.5, 0.8)), key=0.0, sky=0.0, above=0.0, front=0.0, gamma=gamma)
    spans = {"key": (0.25, 0.6), "sky": (0.15, 0.4), "above": (0.0, 0.15), "front": (0.0, 0.25)}
    strengths = {name: float(rng.uniform(*span)) for name, span in spans.items()}
    return Light(turn_deg=turn_deg, height_deg=height_deg, gamma=gamma, **strengths)


def fall(
    light: Light, camera_azimuth_deg: float, normals: Vectors, directions: Vectors, hardness: Numbers, hidden: Occluded
) -> tuple[Numbers, Numbers, Bool[np.ndarray, "n"]]:
    """Diffuse light, highlight (Blinn's half-way vector to the power `hardness`) and which points lie in shadow.

    Args:
      normals: unit, facing the viewer. directions: unit, from the viewer.
    """
    level = normals[:, 1]
    diffuse = np.float32(light.sky) + np.float32(light.above) * level
    diffuse += np.float32(light.front) * np.abs(np.einsum("ij,ij->i", normals, directions))
    shine, shadow = np.zeros_like(diffuse), np.zeros(len(diffuse), dtype=bool)
    if light.lamps:
        diffuse += np.float32(light.lamps) * (1 + level / np.float32(np.sqrt(2)))
        for lamp in LAMPS:
            shine += np.float32(light.lamps) * (0.5 + 0.5 * _half_way(lamp, normals, directions)) ** hardness
    if light.key:
        towards = _direction(camera_azimuth_deg + light.turn_deg, light.height_deg)
        lit = normals @ towards
        shadow = lit <= 0
        facing = np.flatnonzero(~shadow)
        shadow[facing] = hidden(facing, towards)
        diffuse += np.float32(light.key) * np.where(shadow, SHADE, np.float32(1)) * np.maximum(lit, 0)
        glint = np.maximum(_half_way(towards, normals, directions), 0) ** hardness
        shine += np.where(shadow, np.float32(0), glint)
    return diffuse, shine, shadow


def _half_way(light: Float32[np.ndarray, "3"], normals: Vectors, directions: Vectors) -> Numbers:
    """Cosine between the normal and the half-way vector of light and viewer."""
    half = light - directions
    lengths = np.sqrt(np.maximum(np.einsum("ij,ij->i", half, half), np.float32(1e-12)))  # looking along the light: 0
    return np.einsum("ij,ij->i", normals, half) / lengths


def _direction(azimuth_deg: float, height_deg: float) -> Float32[np.ndarray, "3"]:
    """Unit vector, Y up."""
    turn, height = np.radians([azimuth_deg, height_deg])
    return np.array([np.cos(height) * np.cos(turn), np.sin(height), np.cos(height) * np.sin(turn)], dtype=np.float32)

"""Unit vectors that cover the sphere."""

import numpy as np
from jaxtyping import Float


def evenly_spread(count: int) -> Float[np.ndarray, "count 3"]:
    """Evenly spread unit vectors (Fibonacci spiral, offset 1/2), without randomness."""
    index = np.arange(count) + 0.5
    height, turn = 1 - 2 * index / count, np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), height, radius * np.sin(turn)], axis=1)

"""Random streams that depend on names and not on the order of the work."""

import hashlib

import numpy as np

_APART = 1_000_003  # between the numbers of two seeds


def numbered(seed: int, index: int) -> int:
    """A seed for each number of a step or of an image, another for each seed."""
    return seed * _APART + index


def generator(seed: int, *names: str) -> np.random.Generator:
    """A random stream of its own for each seed and list of names, whatever else runs before or beside it."""
    digest = hashlib.sha256("\0".join([str(seed), *names]).encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "little"))

"""Compiled loops over the nodes of a grid, and how loops are compiled. Places are in cells from the first node."""

import inspect
from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function in machine code, made at its first call and kept beside the source."""
    return numba.njit(cache=True, nogil=True, error_model="numpy")(inspect.unwrap(function))


@compiled
def splat(places, values, sums):
    """Add values (n, c) of places (n, 3) to the eight nodes around each, sums (c, x, y, z), by trilinear weights."""
    for i in range(len(places)):
        a, b, c = int(places[i, 0]), int(places[i, 1]), int(places[i, 2])
        x, y, z = places[i, 0] - a, places[i, 1] - b, places[i, 2] - c
        for part in range(8):
            p, q, r = part >> 2, part >> 1 & 1, part & 1
            weight = (x if p else 1 - x) * (y if q else 1 - y) * (z if r else 1 - z)
            for k in range(values.shape[1]):
                sums[k, a + p, b + q, c + r] += weight * values[i, k]


@compiled
def carve(starts, ways, ends, passed):
    """Count the nodes nearest to points of rays, one a cell's side, up to their ends."""
    for ray in range(len(starts)):
        first, last = 0.0, ends[ray]
        for axis in range(3):
            p, v, high = starts[ray, axis] + 0.5, ways[ray, axis], 1.0 * passed.shape[axis]
            if v != 0:
                first, last = max(first, min(-p / v, (high - p) / v)), min(last, max(-p / v, (high - p) / v))
            elif p < 0 or p >= high:
                last = -1.0
        t = first + 0.5
        while t < last:
            i = int(starts[ray, 0] + t * ways[ray, 0] + 0.5)
            j = int(starts[ray, 1] + t * ways[ray, 1] + 0.5)
            k = int(starts[ray, 2] + t * ways[ray, 2] + 0.5)
            if 0 <= i < passed.shape[0] and 0 <= j < passed.shape[1] and 0 <= k < passed.shape[2]:
                passed[i, j, k] += 1
            t += 1.0

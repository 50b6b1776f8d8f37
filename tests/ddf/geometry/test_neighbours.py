"""Nearest neighbours are those of all distances, and their squares are exact."""

import importlib.util

import numpy as np
import pytest

from ddf.geometry import neighbours


@pytest.mark.parametrize("library", ["open3d", "scipy"])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_neighbours_are_the_nearest_and_squares_are_of_the_coordinates_to_the_last_bit(scale, library, monkeypatch):
    if library == "scipy":
        monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    random = np.random.default_rng(0)
    points, queries = scale * random.standard_normal((500, 3)), scale * random.standard_normal((300, 3))
    index, dist_sq = neighbours.Tree(points).search(queries, 4)
    assert (np.diff(dist_sq, axis=1) > 0).all()
    x, y, z = np.moveaxis(queries[:, None] - points, -1, 0)
    every = x**2 + y**2 + z**2
    np.testing.assert_array_equal(index, np.argsort(every, axis=1)[:, :4])
    np.testing.assert_array_equal(dist_sq, np.sort(every, axis=1)[:, :4])

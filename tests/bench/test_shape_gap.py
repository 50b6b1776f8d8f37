"""The distance from public shapes to procedural ones."""

import numpy as np
import pytest

from bench.data import shape_gap


def test_the_nearest_of_moved_planes_is_known_in_closed_form():
    rng = np.random.default_rng(0)
    square = np.concatenate([rng.random((shape_gap.POINTS, 2)), np.zeros((shape_gap.POINTS, 1))], axis=1)
    moved = [square + np.array([0, 0, height]) for height in (0.3, 0.1, 0.2)]
    assert shape_gap.nearest([square], moved) == [pytest.approx(1000 * 2 * 0.1**2)]
    assert shape_gap.nearest([square, moved[1]], moved[1:]) == [pytest.approx(20), pytest.approx(0)]

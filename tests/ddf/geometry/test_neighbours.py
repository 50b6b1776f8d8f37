"""Nearest neighbours by Open3D and by SciPy are the same ones, at the same squared distances."""

import numpy as np
import pytest

from ddf.geometry import neighbours


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_both_trees_give_the_same_to_the_last_bit(scale):
    random = np.random.default_rng(0)
    points, queries = scale * random.standard_normal((500, 3)), scale * random.standard_normal((300, 3))
    index, dist_sq = neighbours.Open3DTree(points).search(queries, 4)
    other_index, other_dist_sq = neighbours.ScipyTree(points).search(queries, 4)
    np.testing.assert_array_equal(index, other_index)
    np.testing.assert_array_equal(dist_sq, other_dist_sq)
    assert (np.diff(dist_sq, axis=1) > 0).all()
    exact = np.sort(((queries[:, None] - points) ** 2).sum(axis=-1), axis=1)[:, :4]
    np.testing.assert_allclose(dist_sq, exact, rtol=1e-14)

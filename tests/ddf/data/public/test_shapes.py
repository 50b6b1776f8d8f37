"""Variations of public shapes: stretched, mirrored, tapered, each within its bounds."""

import itertools

import numpy as np

from ddf.data.public import shapes
from ddf.geometry import mesh_io


def test_variations_stretch_taper_and_mirror_left_for_right():
    corners = np.array(list(itertools.product([1.0, 3.0], [-1.0, 1.0], [-0.5, 1.5])))
    mesh, mirrored, tapered = shapes.plain(mesh_io.Mesh(corners, np.array([[0, 1, 2]]))), [], []
    for seed in range(40):
        made = shapes.varied(mesh, np.random.default_rng(seed))
        edges = [np.diff(made.vertices[:, axis].reshape(2, 2, 2), axis=axis).ravel() for axis in range(3)]
        assert (edges[0] > 0).all() and (edges[1] > 0).all()  # X stays ahead, Y up
        mirrored.append(bool((edges[2] < 0).all()))
        assert mirrored[-1] or (edges[2] > 0).all()
        assert np.array_equal(made.faces, [[2, 1, 0]] if mirrored[-1] else [[0, 1, 2]])
        lengths = np.abs(edges)
        assert (np.abs(np.log(lengths.mean(axis=1) / 2)) <= shapes.STRETCH + 1e-9).all()
        tapered.append(float((lengths.max(axis=1) / lengths.min(axis=1)).max()))
    assert 10 < sum(mirrored) < 30
    most = (1 + shapes.TAPER / 2) / (1 - shapes.TAPER / 2)
    assert max(tapered) <= most + 1e-9 and np.median(tapered) > 1.05

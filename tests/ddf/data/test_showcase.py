"""The shapes of the shipped fields: closed where they should be, of the right size, the same in every run."""

import numpy as np
import trimesh

from ddf.data.synthetic import showcase


def test_rabbit_is_one_closed_surface_symmetric_and_upright():
    rabbit = showcase.rabbit()
    mesh = trimesh.Trimesh(rabbit.vertices, rabbit.faces, process=True)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1
    assert mesh.volume > 0.3  # outward, and not a shell
    lower, upper = rabbit.box()
    assert np.allclose(lower[0], -upper[0], atol=0.02)
    assert np.argmax(upper - lower) == 1  # the ears
    np.testing.assert_allclose(showcase._onto_level_set(rabbit.vertices), rabbit.vertices, atol=1e-6)  # no terraces

"""The shapes of the shipped fields: closed where they should be, of the right size, the same in every run."""

import numpy as np
import pytest
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


def test_nested_boxes_do_not_touch_and_the_window_opens_the_outer_one():
    mesh = showcase.nested()
    inner = mesh.vertices[-8:]
    assert np.abs(inner).max() < 1.0
    lengths = np.linalg.norm(inner, axis=1)
    assert np.allclose(lengths, np.sqrt(3) * 0.42)
    outer = trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)
    parts = sorted(outer.split(only_watertight=False, repair=False), key=lambda part: part.area)
    assert [part.is_watertight for part in parts] == [True, False]
    assert parts[1].area == pytest.approx(6 * 4 - 1.1**2)


@pytest.mark.parametrize("name", ["armchair", "airliner"])
def test_procedural_shapes_are_the_same_in_every_run(name):
    first, second = showcase.SHAPES[name](), showcase.SHAPES[name]()
    assert np.array_equal(first.vertices, second.vertices) and np.array_equal(first.faces, second.faces)
    assert np.linalg.norm(np.ptp(first.vertices[np.unique(first.faces)], axis=0)) == pytest.approx(1.0, abs=1e-6)

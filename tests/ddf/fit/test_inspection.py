"""What is said of a field beside its mesh: nothing of the mesh itself, and closed forms of another shape."""

import numpy as np
import pytest
from _shapes import cube, icosphere, joined, moved

from ddf.fit import fit_folder, inspection
from ddf.geometry import mesh_io, raycast


def asked(mesh: mesh_io.Mesh, instead: mesh_io.Mesh | None = None) -> inspection.MeshField:
    """A mesh as a field, or another one in its box and frame."""
    _, place = fit_folder.in_cube(mesh)
    lower, upper = (place.apply(np.array([corner]))[0] for corner in mesh.box())
    return inspection.MeshField(raycast.Scene(instead or mesh), lower, upper, place)


def measured(field, mesh):
    return inspection.measure(field, inspection.beside(field, mesh))


def test_the_mesh_itself_is_without_fault():
    plate = moved(cube(), np.array([0.3, 0.3, 0.005]), (0.0, 0.0, 0.7))
    mesh = moved(joined(icosphere(3, 0.5), plate), 7.0, (3, 0, -2))
    found = measured(asked(mesh), mesh)
    assert found == pytest.approx({"depth": 0, "silhouettes": 100, "thin": 100, "normals": 0, "inside": 0}, abs=1e-3)
    assert [line[3] for line in inspection.verdicts(found)] == 5 * ["good"]


def test_a_smaller_ball_has_the_errors_of_a_smaller_ball():
    mesh, small = (moved(icosphere(5, radius), 5.0, (1.0, 2.0, 3.0)) for radius in (1.0, 0.9))
    found = measured(asked(mesh, small), mesh)
    assert 78 < found["silhouettes"] < 81  # just under .9^2
    assert 5 < found["depth"] < 7  # a tenth of the radius at the middle, more aside
    assert np.isnan(found["thin"])
    assert found["inside"] > 50


def test_a_lost_rod_is_seen_as_lost():
    ball, rod = icosphere(4, 0.5), moved(cube(), np.array([1.0, 0.008, 0.008]), (0.0, 0.0, 0.7))
    mesh = joined(ball, rod)
    found = measured(asked(mesh, ball), mesh)
    assert found["thin"] == 0
    assert found["silhouettes"] > 90
    assert measured(asked(mesh), mesh)["thin"] > 99


@pytest.mark.parametrize(("name", "values"), [("depth", (0.1, 0.11, 0.51)), ("silhouettes", (99.0, 98.9, 96.9))])
def test_verdicts_change_at_their_bounds(name, values):
    assert [*map(inspection.MEASURES[name].verdict, values)] == ["good", "fair", "poor"]
    assert inspection.MEASURES[name].verdict(float("nan")) == ""

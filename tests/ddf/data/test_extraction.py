"""The six sample types: distributions, truth on shapes with closed forms, seeds, corner cases."""

from typing import Literal

import numpy as np
import pytest
import torch
from _shapes import cube, icosphere, joined, moved, sheet
from _support import assert_close

from ddf.core import checks, seeding
from ddf.data import packing
from ddf.data.samples import draws, extraction, sample_types
from ddf.data.samples.draws import Surface
from ddf.geometry import mesh_io, primitives, raycast, rays

COUNTS = sample_types.each(3000)
CONFIG = extraction.SamplesConfig(counts=COUNTS, offsets="fixed")
SLAB = moved(cube(), np.array([1.0, 0.4, 0.7]), (0, 0, 0))
BALL = moved(icosphere(5), 0.8, (0, 0, 0))
FLAT = mesh_io.Mesh(np.array([[0.0, 0, 0], [0.5, 0, 0], [1, 0, 0]]), np.array([[0, 1, 2]]))
TIGHT = draws.Box(np.array([-1.0, -0.4, -0.7]), np.array([1.0, 0.4, 0.7]))


def _decoded(mesh: mesh_io.Mesh, kind: str, config: extraction.SamplesConfig = CONFIG) -> packing.Samples:
    arrays = extraction.extract(mesh, config, "test")
    return packing.decode({name: torch.from_numpy(values) for name, values in arrays.items()}, kind)


def _surface(mesh: mesh_io.Mesh) -> Surface:
    return extraction.surface_of(raycast.Scene(mesh))


def _random() -> np.random.Generator:
    return np.random.default_rng(5)


@pytest.mark.parametrize("kind", ["U", "A", "B", "O"])
def test_truth_equals_closed_form_of_box(kind):
    samples = _decoded(SLAB, kind)
    p, v = samples["positions"].double(), torch.nn.functional.normalize(samples["directions"].double(), dim=-1)
    truth = primitives.cast(primitives.Box((-1.0, -0.4, -0.7), (1.0, 0.4, 0.7)), rays.OrientedPoints(p, v))
    same = truth.visible == samples["visible"]
    assert same.float().mean() > 0.99  # rays that start on the surface, or run in it, may go either way
    seen = same & truth.visible & ((truth.normals * v).sum(-1) < -0.01) & (truth.depth > 1e-4)
    assert seen.sum() > 100
    assert_close(samples["depth"][seen], truth.depth[seen], atol=1e-4, rtol=0)
    aligned = (samples["normals"][seen].double() * truth.normals[seen]).sum(-1)
    assert (aligned > np.cos(np.radians(1))).float().mean() > 0.995  # but for hits within rounding of an edge


def test_surface_samples_see_past_their_own_triangle():
    mesh = icosphere(4)
    samples = _decoded(mesh, "S")
    p, v = samples["positions"].double(), samples["directions"].double()
    assert_close(p.norm(dim=-1), torch.ones(len(p), dtype=torch.float64), atol=3e-3)
    inward = (p * v).sum(-1)
    assert not samples["visible"][inward > 0.06].any()
    crossing = inward < -0.06
    assert samples["visible"][crossing].all()
    assert_close(samples["depth"][crossing], -2 * inward[crossing], atol=2e-2)  # chord of the sphere, facets by h²
    assert abs(float(samples["visible"].float().mean()) - 0.5) < 0.03


def test_surface_samples_on_a_plane_see_nothing():
    """All hits would be of the own triangle or of coplanar neighbours."""
    flat = sheet(21)
    turn = np.linalg.qr(_random().standard_normal((3, 3)))[0]
    assert not _decoded(mesh_io.Mesh((2 * flat.vertices - [1, 1, 0]) @ turn * 0.7, flat.faces), "S")["visible"].any()


def test_tangent_samples_are_cast_as_the_paper_does():
    """Their truth is that of the stored ray; about half of those that graze a sphere miss it."""
    samples = _decoded(BALL, "T")
    cast = raycast.cast(BALL, rays.OrientedPoints(samples["positions"].double(), samples["directions"].double()))
    same = cast.visible == samples["visible"]
    assert same.float().mean() > 0.97  # but for rays within rounding of an edge
    both = cast.visible & samples["visible"]
    apart = (samples["depth"][both].double() - cast.depth[both]).abs()
    assert (apart < 1e-3).double().mean() > 0.99  # nearly along the facets, a rounded ray may enter elsewhere
    assert 0.4 < float(samples["visible"].float().mean()) < 0.6


@pytest.mark.parametrize("kind", ["S", "T"])
def test_samples_of_transitions_have_the_normal_at_their_origin(kind):
    """Also where the ray sees another surface, or none."""
    samples = _decoded(BALL, kind)
    p, v = samples["positions"], samples["directions"]
    origin = p if kind == "S" else p - (p * v).sum(-1, keepdim=True) * v
    aligned = (torch.nn.functional.normalize(origin, dim=-1) * samples["normals"]).sum(-1)
    assert (aligned > np.cos(np.radians(3))).all()


def test_at_surface_samples_see_the_surface_no_further_than_their_origin():
    samples = _decoded(SLAB, "A")
    assert samples["visible"].float().mean() > 0.995


@pytest.mark.parametrize("box", [draws.CUBE, TIGHT], ids=["cube", "tight"])
@pytest.mark.parametrize("kind", ["A", "T", "O"])
def test_a_tenth_lies_on_the_boundary_and_all_in_the_box(kind, box):
    sphere = moved(icosphere(3), np.array([1.0, 0.4, 0.7]), (0, 0, 0))
    box = box if box is draws.CUBE else draws.Box(*sphere.box())
    drawn = sample_types.DRAWS[kind](draws.Domain(_surface(sphere), box, 0.02, True), 5000, _random())
    on_wall = ((drawn.positions == box.lower) | (drawn.positions == box.upper)).any(axis=1)
    assert abs(on_wall.sum() - 500) <= 5  # in a tight box an origin can touch a wall by itself
    assert (drawn.positions >= box.lower).all() and (drawn.positions <= box.upper).all()
    assert_close(np.linalg.norm(drawn.directions, axis=1), np.ones(5000))


def _offsets(kind: str, offsets: Literal["fixed", "uniform"]) -> np.ndarray:
    """How far outside the ball the lines of the samples pass it."""
    domain = draws.Domain(_surface(BALL), draws.CUBE, 0.05, offsets == "uniform")
    drawn = sample_types.DRAWS[kind](domain, 4000, _random())
    foot = drawn.positions - (drawn.positions * drawn.directions).sum(1, keepdims=True) * drawn.directions
    return np.linalg.norm(foot, axis=1) - 0.8


def test_tangent_lines_touch_and_offset_lines_keep_their_distance_or_fill_the_interval():
    assert_close(_offsets("T", "fixed"), np.zeros(4000), atol=2e-3)
    fixed, uniform = _offsets("O", "fixed"), np.abs(_offsets("O", "uniform"))
    assert_close(np.abs(fixed), np.full(4000, 0.05), atol=2e-3)
    assert abs((fixed > 0).mean() - 0.5) < 0.03
    assert uniform.max() < 0.052
    assert_close(np.histogram(uniform, bins=5, range=(0, 0.05))[0] / 4000, np.full(5, 0.2), atol=0.03)


def test_offset_samples_of_a_flat_shape_stay_in_its_tight_box():
    square = mesh_io.Mesh(2 * sheet(2).vertices - [1, 1, 0], sheet(2).faces)
    drawn = draws.draw_offset(draws.Domain(_surface(square), draws.Box(*square.box()), 0.02), 500, _random())
    assert (drawn.positions[:, 2] == 0).all() and np.abs(drawn.positions).max() <= 1


@pytest.mark.parametrize("box", [draws.CUBE, TIGHT], ids=["cube", "tight"])
def test_bounding_samples_are_uniform_by_area_and_look_inwards(box):
    drawn = draws.draw_bounding(draws.Domain(_surface(SLAB), box), 20_000, _random())
    on_lower, on_upper = drawn.positions == box.lower, drawn.positions == box.upper
    assert (on_lower.sum(axis=1) + on_upper.sum(axis=1) == 1).all()
    assert (drawn.directions[on_lower] >= 0).all() and (drawn.directions[on_upper] <= 0).all()
    sides = box.upper - box.lower
    areas = np.array([sides[1] * sides[2], sides[2] * sides[0], sides[0] * sides[1]])
    expected = np.concatenate([areas, areas]) / (2 * areas.sum())
    assert_close(np.concatenate([on_lower.mean(axis=0), on_upper.mean(axis=0)]), expected, atol=0.012, rtol=0)
    inward = np.concatenate([drawn.directions[on_lower], -drawn.directions[on_upper]])
    assert abs(inward.mean() - 0.5) < 0.01  # the cosine is uniform on [0, 1] on a hemisphere


def test_directions_are_uniform_on_the_sphere():
    directions = draws.unit_vectors(40_000, _random())
    assert_close(directions.mean(axis=0), np.zeros(3), atol=0.012)
    assert_close(directions.T @ directions / 40_000, np.eye(3) / 3, atol=0.006)


def test_surface_points_are_uniform_by_area_and_skip_degenerate_triangles():
    mesh = joined(FLAT, SLAB, FLAT)
    _, face = Surface.of(mesh).draw(20_000, _random())
    _, areas = mesh_io.face_normals(mesh)
    share = np.bincount(face, minlength=len(mesh.faces)) / 20_000
    assert share[0] == share[-1] == 0
    assert_close(share, areas / areas.sum(), atol=0.012, rtol=0)
    with_them = extraction.extract(mesh, CONFIG, "test")
    without = extraction.extract(SLAB, CONFIG, "test")
    assert all((with_them[name] == without[name]).all() for name in without)


def test_surface_points_are_uniform_within_a_triangle():
    corners = np.array([[0.0, 0, 0], [0.9, 0, 0], [0, 0.6, 0]])
    points, _ = _surface(mesh_io.Mesh(corners, np.array([[0, 1, 2]]))).draw(20_000, _random())
    assert_close(points.mean(axis=0), corners.mean(axis=0), atol=0.005, rtol=0)


def test_equal_seeds_give_equal_bytes_and_types_do_not_share_a_stream():
    first = extraction.extract(SLAB, CONFIG, "chair", "a")
    again = extraction.extract(SLAB, CONFIG, "chair", "a")
    other = extraction.extract(SLAB, CONFIG, "chair", "b")
    assert all((first[name] == again[name]).all() for name in first)
    assert not (first["U.positions"] == other["U.positions"]).all()
    names = (("a", "b"), ("ab",), ("a", "c"), ("b", "a"))
    assert len({seeding.generator(seed, *each).integers(1 << 60) for each in names for seed in (0, 1)}) == 8
    fewer = extraction.SamplesConfig(counts={**sample_types.each(10), "A": 3000}, offsets="fixed")
    assert (extraction.extract(SLAB, fewer, "chair", "a")["A.depth"] == first["A.depth"]).all()


def test_mesh_outside_the_cube_and_bad_settings_are_refused():
    with pytest.raises(checks.InputError, match=r"must lie in \[-1, 1\]"):
        extraction.extract(cube(1.1), CONFIG, "x")
    for counts in ({**COUNTS, "A": 0}, {**COUNTS, "E": 5}):
        with pytest.raises(checks.InputError, match=r"counts may give each of U, A, B, S, T, O >= 1; got"):
            extraction.SamplesConfig(counts)
    given = extraction.SamplesConfig({"T": 7, "U": 5}).counts
    others = ((kind, sample_types.LEFT_OUT) for kind in "ABS")
    assert list(given.items()) == [("U", 5), *others, ("T", 7), ("O", 10_000)]
    with pytest.raises(checks.InputError, match="epsilon_o"):
        extraction.SamplesConfig(epsilon_o=0.0)
    with pytest.raises(checks.InputError, match="triangle with an area"):
        extraction.extract(FLAT, CONFIG, "x")


def test_a_config_says_whether_o_samples_are_all_at_their_distance():
    configs = (extraction.SamplesConfig(sample_types.each(200), 0.05, offsets) for offsets in ("fixed", "uniform"))
    fixed, uniform = (extraction.extract(BALL, config, "s")["O.positions"] for config in configs)
    assert not np.array_equal(fixed, uniform)

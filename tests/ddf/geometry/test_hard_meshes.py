"""Hard meshes, cast by the tree and one by one: no leaks, thin gaps, starts on faces, flat triangles, far away."""

import math

import numpy as np
import pytest
import torch
from _hard import DIRECTIONS, FAR, SLOPES, TARGETS, assert_exact, assert_refused, assert_within, box, step
from _shapes import joined

from bench.lib import exact_cast
from ddf.data import mesh_topology
from ddf.data.samples import draws, extraction
from ddf.data.samples.draws import Surface
from ddf.geometry import mesh_io, raycast, rays, transforms

both_casts = pytest.mark.parametrize("cast", [raycast.cast, exact_cast.cast])
CUBE = box((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
TURN = torch.linalg.matrix_exp(
    torch.tensor([[0.0, 0.3, -0.7], [-0.3, 0.0, 0.4], [0.7, -0.4, 0.0]], dtype=torch.float64)
)
TURNED = mesh_io.Mesh(CUBE.vertices @ TURN.numpy().T, CUBE.faces)


def _square(height):
    """[-1, 1]² at y = height."""
    corners = np.array([[-1.0, height, -1.0], [1.0, height, -1.0], [1.0, height, 1.0], [-1.0, height, 1.0]])
    return mesh_io.Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def _points(positions, directions, dtype):
    return rays.OrientedPoints(positions.to(dtype), directions.to(dtype))


def _along(*directions):
    return torch.tensor(directions, dtype=torch.float64)


@both_casts
def test_no_leak_through_edges_and_vertices_of_a_turned_cube(cast, dtype):
    """From the centre to corners and along edges and face diagonals, and back from outside: 390 rays."""
    share = torch.linspace(0, 1, 10, dtype=torch.float64)[1:-1, None]
    corners = torch.from_numpy(CUBE.triangles)
    sides = [(1 - share) * a + share * b for c in corners for a, b in ((c[0], c[1]), (c[1], c[2]), (c[2], c[0]))]
    targets = torch.cat([corners.reshape(-1, 3), *sides]).unique(dim=0) @ TURN.T
    length = targets.norm(dim=-1)
    outwards = targets / length[:, None]
    allowed = 40 * step(dtype)  # a direction's rounding times the distance, over the cosine of at worst 1/sqrt(3)
    assert_within(cast(TURNED, _points(torch.zeros_like(targets), outwards, dtype)).depth, length, allowed)
    assert cast(TURNED, _points(3 * outwards, -outwards, dtype)).visible.all()


@both_casts
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_no_leak_along_directions_with_exact_zeros_at_any_size(size, cast, dtype):
    points = _points(torch.zeros_like(DIRECTIONS), DIRECTIONS, dtype)
    depth = cast(mesh_io.Mesh(size * CUBE.vertices, CUBE.faces), points).depth
    assert_within(depth / size, TARGETS.norm(dim=-1), 4 * step(dtype))


@both_casts
@pytest.mark.parametrize("slope", SLOPES)
def test_grazing_a_flat_mesh_hits_within_the_rounding_over_the_slope(slope, cast, dtype):
    direction = _along((math.sqrt(1 - slope * slope), -slope, 0.0)).to(dtype)
    start = (torch.tensor([[0.1, 0.0, 0.2]], dtype=torch.float64) - 0.5 * direction.double()).to(dtype)
    expected = start[:, 1].double() / -direction[:, 1].double()
    allowed = 2 * step(dtype) / slope
    assert_within(cast(_square(0.0), rays.OrientedPoints(start, direction)).depth, expected, allowed)


@both_casts
def test_starts_on_a_face_hit_at_zero(cast, dtype):
    start = torch.tensor([[1.0, 0.25, 0.5]] * 2, dtype=torch.float64)
    assert_exact(cast(CUBE, _points(start, _along((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)), dtype)).depth, [0.0, 0.0])


@both_casts
@pytest.mark.parametrize("gap", [1e-5, 1e-7])
def test_starts_beside_a_slanted_face_see_the_gap_to_1e_12(gap, cast, dtype):
    """200 starts outside and inside; truth: the gap of the start as rounded (1e-7 is less than that rounding)."""
    generator = torch.Generator().manual_seed(0)
    flat = 1.8 * torch.rand(200, 3, generator=generator, dtype=torch.float64) - 0.9
    side = torch.where(torch.arange(200) % 2 == 0, 1.0, -1.0).double()
    flat[:, 0] = 1 + gap * side
    normal = TURN[:, 0]
    start, looking = (flat @ TURN.T).to(dtype), (-side[:, None] * normal).to(dtype)
    left = side * (start.double() @ normal - 1)
    near = left > 0.1 * gap  # rounding to the type moves some starts onto the face or through it
    assert_within(cast(TURNED, rays.OrientedPoints(start[near], looking[near])).depth, left[near], 1e-12)


@both_casts
def test_of_two_sheets_1e_5_apart_the_near_one_is_hit(cast, dtype):
    """From above, from below, and from the middle of the gap both ways."""
    start = torch.tensor([[0.1, y, 0.2] for y in (1.0, -1.0 - 1e-5, -5e-6, -5e-6)], dtype=torch.float64)
    looking = _along((0.0, -1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))
    points = _points(start, looking, dtype)
    y = points.positions[:, 1].double()
    expected = torch.stack((y[0], -1e-5 - y[1], -y[2], y[3] + 1e-5))
    assert_within(cast(joined(_square(0.0), _square(-1e-5)), points).depth, expected, 1e-12)


@both_casts
def test_nothing_but_degenerate_triangles_is_missed_and_refused(cast, dtype):
    flat = mesh_io.Mesh(np.zeros((3, 3)), np.array([[0, 1, 2], [0, 0, 1], [1, 1, 1]]))
    points = _points(torch.zeros(1, 3) - 1, _along((1.0, 0.0, 0.0)), dtype)
    assert_exact(cast(flat, points).depth, [math.inf])
    beside = cast(joined(flat, CUBE), _points(_along((-2.0, 0.0, 0.0)), _along((1.0, 0.0, 0.0)), dtype))
    assert_exact(beside.depth, [1.0])
    assert beside.face[0] >= len(flat.faces)
    assert_refused(lambda: mesh_topology.clean(flat), "no triangle has an area")
    assert_refused(lambda: Surface.of(flat).draw(1, np.random.default_rng(0)), "must have a triangle with an")
    assert_refused(lambda: transforms.field_from_mesh(flat.vertices), "vertices must span a box")


def test_meshes_that_are_not_meshes_are_refused():
    broken = CUBE.vertices.copy()
    broken[5, 1] = np.nan
    assert_refused(lambda: mesh_io.Mesh(broken, CUBE.faces), r"vertices must be finite; got nan at index \(5, 1\)")
    for index in (-1, 8):
        faces = np.array([[0, 1, index]])
        assert_refused(lambda f=faces: mesh_io.Mesh(CUBE.vertices, f), f"faces must index .*; got index {index}")


@both_casts
def test_a_mesh_1e6_from_its_origin_has_the_depths_of_one_at_its_origin(cast, dtype):
    start = torch.tensor([[0.5, 0.25, 0.0], [-2.0, 0.25, 0.5], [0.25, 3.0, 0.25], [-2.0, 1.25, 0.0]])
    looking = _along((1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0))
    points = _points(start + torch.from_numpy(FAR), looking, dtype)
    depth = cast(mesh_io.Mesh(CUBE.vertices + FAR, CUBE.faces), points).depth
    assert_within(depth, [0.5, 1.0, 2.0, math.inf], 1e-9)


def test_a_mesh_1e6_from_its_origin_is_normalised_exactly_and_comes_back(dtype):
    here = box((-1.0, -0.5, -0.25), (1.0, 0.5, 0.25)).vertices
    there = torch.from_numpy(here + FAR).to(dtype).double().numpy()
    frame = transforms.field_from_mesh(there)
    assert_exact(frame.apply(there), here)
    assert_within(frame.inverse().apply(frame.apply(there)), there, 1e-9)


@both_casts
def test_rays_from_1e5_away_are_as_exact_as_their_starts(cast, dtype):
    target = 1.8 * torch.rand(100, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64) - 0.9
    target[:, 0] = -1.0
    start = target - torch.tensor([1e5, 0.0, 0.0], dtype=torch.float64)
    points = _points(start, _along((1.0, 0.0, 0.0)).expand(100, 3), dtype)
    assert_within(cast(CUBE, points).depth, -1 - points.positions[:, 0].double(), 1e-9)


def test_offset_lines_beside_the_wall_of_the_box_stay_in_it():
    """2,000 samples of type O, ε = 0.05, of the cube that fills its box: half of the lines would leave it."""
    surface = extraction.surface_of(raycast.Scene(CUBE))
    drawn = draws.draw_offset(draws.Domain(surface, draws.CUBE, 0.05), 2000, np.random.default_rng(0))
    depth = np.abs(drawn.positions.astype(np.float64))
    assert depth.max() <= 1
    assert_within(np.abs(depth - 0.95).min(-1), np.zeros(2000), 2 * step(torch.float32))

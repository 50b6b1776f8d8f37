"""Parts of synthetic shapes: closed, wound outwards, of the volume and place that they are asked for."""

import numpy as np
import pytest
from _shapes import area_and_volume
from _support import assert_close

from ddf.data import mesh_topology
from ddf.data.synthetic import assemble, chairs, parts
from ddf.geometry import mesh_io

PAINT = parts.Paint((0.5, 0.5, 0.5))


def _volume(part):
    return area_and_volume(mesh_io.Mesh(part.vertices, part.triangles))[1]


def _is_solid(part):
    """Closed once equal points are one, and wound outwards."""
    _, first, welded = np.unique(part.vertices.round(9), axis=0, return_index=True, return_inverse=True)
    faces = welded.ravel()[part.triangles]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    return mesh_topology.is_watertight(mesh_io.Mesh(part.vertices[first], faces)) and _volume(part) > 0


def _bent_tube(**options):
    return parts.tube([(0, 0, 0), (1, 0, 0), (1.5, 0.5, 0.2), (1.5, 1.5, 0.4)], 0.1, PAINT, **options)


CLOSED = {
    "box": lambda: parts.box((1, 2, 3), (1, 2, 3), PAINT),
    "tapered box": lambda: parts.box((0, 0, 0), (1, 1, 1), PAINT, taper=(0.5, 0.2)),
    "tube": _bent_tube,
    "ring": lambda: parts.tube([(1, 0, 0), (0, 0, 1), (-1, 0, 0), (0, 0, -1)], 0.2, PAINT, closed=True),
    "beam": lambda: parts.beam((0, 0, 0), (1, 2, 3), (0.1, 0.2), PAINT),
    "lathe y": lambda: parts.lathe(parts.disc_profile(0.5, 0.2, 0.05), PAINT),
    "lathe x": lambda: parts.lathe(parts.disc_profile(0.5, 0.2, 0.05), PAINT, axis="x"),
    "lathe z": lambda: parts.lathe(parts.disc_profile(0.5, 0.2, 0.05), PAINT, axis="z"),
    "mirrored": lambda: _bent_tube().mirrored(),
    "turned": lambda: _bent_tube(sides=5).turned("x", 1.0, (1, 2, 3)).turned("y", 2.0).turned("z", 3.0),
}


@pytest.mark.parametrize("name", CLOSED)
def test_closed_parts_are_wound_outwards_without_gaps(name):
    assert _is_solid(CLOSED[name]())


def test_volumes_of_box_and_frustum():
    assert_close(_volume(parts.box((5, -2, 1), (1, 2, 3), PAINT)), 6.0, atol=1e-12)
    frustum = parts.box((0, 0, 0), (2, 3, 2), PAINT, taper=(0.5, 0.5))
    assert_close(_volume(frustum), 3 / 3 * (4 + 1 + 2), atol=1e-12)


def test_lathe_volume_converges_to_the_cylinder_as_the_square_of_the_sides():
    exact = np.pi * 0.5**2 * 0.4
    errors = [exact - _volume(parts.lathe(parts.disc_profile(0.5, 0.2), PAINT, sides=sides)) for sides in (16, 32, 64)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert_close(rates, np.full(2, 2.0), atol=0.02)


def test_tube_stays_at_its_radius_from_a_straight_path():
    path = np.linspace([0, 0, 0], [1, 2, 2], 5)
    part = parts.tube(path, 0.25, PAINT, sides=7)
    axis = np.array([1, 2, 2]) / 3
    points = part.vertices[: 5 * 7]  # without those of the ends
    off_axis = points - np.outer(points @ axis, axis)
    assert_close(np.linalg.norm(off_axis, axis=1), np.full(len(off_axis), 0.25), atol=1e-12)


def test_curve_passes_through_its_knots():
    knots = np.random.default_rng(0).standard_normal((5, 3))
    assert_close(parts.curve(knots, 4 * 6 + 1)[::6], knots, atol=1e-12)


def test_rotations_are_right_handed():
    for axis, start, end in (("x", "y", "z"), ("y", "z", "x"), ("z", "x", "y")):
        unit = dict(zip("xyz", np.eye(3), strict=True))
        assert_close(parts.rotation(axis, np.pi / 2) @ unit[start], unit[end], atol=1e-12)


def test_corner_normals_are_flat_on_a_box_and_radial_on_a_fine_sphere():
    box = parts.box((0, 0, 0), (1, 1, 1), PAINT)
    a, b, c = box.vertices[box.triangles].transpose(1, 0, 2)
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert_close(assemble.corner_normals(box.vertices, box.triangles), np.repeat(flat[:, None], 3, axis=1), atol=1e-6)
    polar = np.linspace(-np.pi / 2, np.pi / 2, 33)[1:-1]
    ball = parts.lathe(list(zip(np.cos(polar), np.sin(polar), strict=True)), PAINT, sides=64)
    inner = np.abs(ball.vertices[:, 1]) < 0.9
    corners = inner[ball.triangles]
    normals = assemble.corner_normals(ball.vertices, ball.triangles)[corners]
    cosines = (normals * ball.vertices[ball.triangles][corners]).sum(axis=1)
    assert cosines.min() > np.cos(np.radians(1.0))


FAMILIES = [family for family, _ in chairs.FAMILIES[1:]]
OWN_PARTS = {  # what a family adds to the parts of others
    chairs.tub: {"shell", "body"},
    chairs.club: {"cushion", "foot"},
    chairs.lounge: {"sheet"},
    chairs.bent: {"panel", "hoop", "leg"},
    chairs.stool: {"ring"},
    chairs.with_tray: {"tray"},
}


@pytest.mark.parametrize("family", OWN_PARTS)
def test_closed_parts_of_wide_chairs_are_whole_and_wound_outwards(family):
    every = (part for seed in range(12) for part in family(np.random.default_rng(seed)))
    own = [part for part in every if part.name in OWN_PARTS[family]]
    assert {part.name for part in own} == OWN_PARTS[family]
    assert [part.name for part in own if not _is_solid(part)] == []


@pytest.mark.parametrize("family", FAMILIES)
def test_a_wide_chair_stands_on_the_floor_and_its_back_is_behind(family):
    leaning = []
    for seed in range(12):
        points = np.concatenate([part.vertices for part in family(np.random.default_rng(seed))])
        assert abs(points[:, 1].min()) < 0.06 and 0.3 < points[:, 1].max() < 2.0
        assert np.ptp(points[:, 2]) < 1.8 and abs(points[:, 2].max() + points[:, 2].min()) < 0.25
        leaning.append(points[points[:, 1] > 0.9 * points[:, 1].max(), 0].mean() < 0)
    assert family is chairs.stool or np.mean(leaning) >= 0.8

"""Synthetic shapes as they are written: frame, determinism, variety, and masks that hold the whole shape."""

import dataclasses
import hashlib

import numpy as np
import pytest
import torch
from _support import assert_close
from PIL import Image

from ddf.data import shapenet
from ddf.data.samples import draws
from ddf.data.synthetic import assemble, render, write
from ddf.geometry import cameras, mesh_io

CATEGORIES = tuple(write.CATEGORIES)


def _surface_points(mesh, count, random):
    """Uniform points, plus all corners and the middles of all edges: the thinnest places."""
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    inner = draws.Surface.of(mesh).draw(count, random)[0]
    return np.concatenate([inner, mesh.surface_vertices(), (a + b) / 2, (b + c) / 2, (c + a) / 2])


def _digests(root):
    files = (path for path in sorted(root.rglob("*")) if path.is_file())
    return {path.relative_to(root).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.mark.parametrize("category", CATEGORIES)
def test_written_shape_has_the_v1_frame_and_lies_inside_every_mask(tmp_path, category):
    random = np.random.default_rng(5)
    for index in range(2):
        files = write.write_shape(tmp_path, 7, category, index, 24)
        assert len(files) == 24 + 3
        mesh = mesh_io.load(files[0])
        lower, upper = mesh.box()
        assert_close(lower + upper, np.zeros(3), atol=3e-8)
        assert_close(np.linalg.norm(upper - lower), 1.0, atol=3e-8)
        points = torch.from_numpy(_surface_points(mesh, 150_000, random)) * 0.57
        poses = torch.from_numpy(shapenet.read_cameras(files[-1].parent))
        assert len(poses) == 24
        for view, pose in enumerate(cameras.degrees_to_radians(poses)):
            some = points if view == 0 else points[120_000:]
            u, v = cameras.project(some, *cameras.extrinsics(*pose))
            with Image.open(files[1 + view]) as image:
                assert (image.size, image.mode) == ((137, 137), "RGBA")
                pixels = np.array(image)
            alpha = pixels[v.floor().long().numpy(), u.floor().long().numpy(), 3]
            assert (alpha > 0).all(), f"{category} {index} view {view}: {(alpha == 0).sum()} points outside"
            assert (pixels[pixels[..., 3] == 0] == 0).all()
            if view == 0:  # and no more than the shape: with so many points hardly a whole pixel has none
                covered = np.zeros((137, 137), dtype=bool)
                covered[v.floor().long().numpy(), u.floor().long().numpy()] = True
                assert ((pixels[..., 3] == 255) & ~covered).sum() < 0.02 * covered.sum()


def test_cameras_have_the_distribution_of_the_renders():
    views = [view for index in range(100) for view in write.make_views(0, "chair", index, 24)]
    table = np.array([[view.azimuth_deg, view.elevation_deg, view.ratio] for view in views])
    lower, upper = np.array([0, 25, 0.65]), np.array([360, 30, 0.95])
    assert (table >= lower).all() and (table <= upper).all()
    uniform = np.sort((table - lower) / (upper - lower), axis=0)
    expected = (np.arange(len(table)) + 0.5)[:, None] / len(table)
    # Kolmogorov-Smirnov at 1e-4 for 2,400 draws: 2.2 / sqrt(n).
    assert np.abs(uniform - expected).max() < 2.2 / np.sqrt(len(table))


def test_same_seed_gives_same_bytes_and_another_seed_does_not(tmp_path):
    for folder, seed in (("a", 1), ("b", 1), ("c", 2)):
        for category in CATEGORIES[:: -1 if folder == "b" else 1]:  # in whatever order
            write.write_shape(tmp_path / folder, seed, category, 3, 2)
    first, again, other = (_digests(tmp_path / folder) for folder in "abc")
    assert first == again
    assert not set(first) & set(other)
    assert len(set(first.values()) & set(other.values())) == 1  # renderings.txt


@pytest.mark.parametrize("wide", [False, True], ids=["plain", "wide"])
@pytest.mark.parametrize("category", ["chair", "plane", "car"])
def test_shapes_are_sound_varied_and_untidy(category, wide):
    shapes = [write.make_shape(0, category, index, wide) for index in range(20)]
    counts = [len(shape.triangles) for shape in shapes]
    assert min(counts) >= 300 and max(counts) <= 8000
    assert len(set(counts)) > 10
    for shape in shapes:
        assert np.isfinite(shape.vertices).all() and np.isfinite(shape.normals).all()
        assert shape.triangles.min() >= 0 and shape.triangles.max() < len(shape.vertices)
        assert sum(count for _, count in shape.parts) == len(shape.triangles)
        assert ((shape.colours >= 0) & (shape.colours <= 1)).all()
    extents = np.array([np.ptp(shape.vertices, axis=0) for shape in shapes])
    assert (extents.std(axis=0) > 0.015).all()
    lengths = np.array([np.linalg.norm(shape.normals, axis=-1) for shape in shapes[:1]])
    assert ((np.abs(lengths - 1) < 1e-4) | (lengths == 0)).all()
    assert sum(_edges(shape, True).max() > 1 for shape in shapes) >= 5  # badly wound
    assert sum(_edges(shape, False).min() == 1 for shape in shapes) >= 5  # open


def _edges(shape, directed):
    """How often each edge is there, in each of its directions or in either."""
    _, welded = np.unique(shape.vertices, axis=0, return_inverse=True)
    triangles = welded.ravel()[shape.triangles]
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    return np.unique(edges if directed else np.sort(edges, axis=1), axis=0, return_counts=True)[1]


@pytest.mark.parametrize("wide", [False, True], ids=["plain", "wide"])
def test_faces_of_seat_and_nose_point_to_plus_x(wide):
    """All shapes face +X: a plane's fin and a chair's back are behind the middle, a car's cabin too."""
    for index in range(20):
        chair, plane = (write.make_shape(3, category, index, wide) for category in ("chair", "plane"))
        high = chair.vertices[chair.vertices[:, 1] > 0.9 * chair.vertices[:, 1].max()]
        assert high[:, 0].mean() < (1e-9 if wide else 0)  # a wide stool has no back
        fin = np.repeat([name == "fin" for name, _ in plane.parts], [count for _, count in plane.parts])
        assert plane.vertices[plane.triangles[fin]][..., 0].mean() < -0.1


def test_wide_designs_stand_on_wheels_and_leave_other_categories_alone():
    for index in range(30):
        car, plain = (write.make_shape(5, "car", index, wide) for wide in (True, False))
        assert len(car.vertices) != len(plain.vertices)
        owners = np.repeat([name for name, _ in car.parts], [count for _, count in car.parts])
        lowest = car.vertices[car.triangles][..., 1].min(axis=1)
        assert_close(lowest[owners == "tyre"].min(), car.vertices[:, 1].min(), atol=1e-7)
    one, other = (write.make_shape(5, "primitives", 0, wide) for wide in (True, False))
    assert (one.vertices == other.vertices).all()


def test_untidying_moves_no_triangle():
    def corners(items):
        every = (each for part in items for each in part.vertices[part.triangles].tolist())
        return {tuple(sorted(map(tuple, each))) for each in every}

    random, items = np.random.default_rng(0), write.CATEGORIES["chair"](np.random.default_rng(4))
    pieces = [assemble.Piece(part, assemble.corner_normals(part.vertices, part.triangles)) for part in items]
    for _ in range(10):
        assert corners(piece.part for piece in assemble.untidy(pieces, random)) == corners(items)


def test_traverse_finds_every_pixel_of_a_segment():
    random = np.random.default_rng(1)
    ends = random.uniform(0, 12, (40, 2, 2))
    columns, rows, owner = render.traverse(ends)
    shares = np.linspace(0, 1, 8_001)[:, None]
    for i, (start, end) in enumerate(ends):
        dense = {tuple(pixel) for pixel in np.floor(start + shares * (end - start)).astype(int).tolist()}
        found = set(zip(columns[owner == i].tolist(), rows[owner == i].tolist(), strict=True))
        assert dense <= found and len(found) <= len(dense) + 1  # a corner that the dense points miss


def test_alpha_of_a_sphere_is_its_projected_area():
    """The outline of a sphere of radius r at distance d is a circle on the image only in the middle; there it has
    area π f² r² / (d² - r²).
    """
    shapes = (write.make_shape(0, "primitives", index) for index in range(50))
    balls = (s for s in shapes if s.parts[0][0] == "sphere" and np.ptp(np.ptp(s.vertices, axis=0)) < 0.25)
    sphere = next(balls)
    unit = sphere.vertices / np.linalg.norm(sphere.vertices, axis=1, keepdims=True)
    ball = dataclasses.replace(sphere, vertices=unit * 0.29)
    alpha = render.Renderer(ball).render(render.View(120.0, 27.0, 0.8))[..., 3] / 255
    radius = 0.57 * 0.29
    exact = np.pi * cameras.FOCAL_PX**2 * radius**2 / (0.8**2 - radius**2)
    assert_close(alpha.sum(), exact, atol=0, rtol=1e-2)

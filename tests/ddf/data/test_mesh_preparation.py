"""Closing, decimating and measuring meshes."""

from typing import Any

import numpy as np
import pytest
import trimesh
from _shapes import cube, icosphere, joined, moved, sheet, torus
from _support import assert_close

from ddf.core import checks
from ddf.data import mesh_preparation, mesh_topology
from ddf.geometry import mesh_io, raycast


def _random() -> np.random.Generator:
    return np.random.default_rng(0)


def _prepared(raw: mesh_io.Mesh, **settings: Any) -> mesh_preparation.Prepared:
    return mesh_preparation.prepare(raw, mesh_preparation.MeshesConfig(measure_points=2000, **settings), _random())


def _inside_out(mesh: mesh_io.Mesh) -> mesh_io.Mesh:
    return mesh_io.Mesh(mesh.vertices, mesh.faces[:, ::-1])


def _unwelded(mesh: mesh_io.Mesh, noise: float = 0.0) -> mesh_io.Mesh:
    corners = mesh.triangles.reshape(-1, 3)
    moved_by = noise * _random().standard_normal(corners.shape)
    return mesh_io.Mesh(corners + moved_by, np.arange(len(corners)).reshape(-1, 3))


def _plate(lower: tuple[float, float, float], upper: tuple[float, float, float], steps: int = 4) -> mesh_io.Mesh:
    """A flat open grid in the plane of its two extended axes."""
    low, high = np.array(lower, float), np.array(upper)
    grid = sheet(steps)
    vertices = np.tile(low, (steps * steps, 1))
    vertices[:, high > low] += grid.vertices[:, :2] * (high - low)[high > low]
    return mesh_io.Mesh(vertices, grid.faces)


def test_watertight_means_every_edge_twice_in_opposite_ways():
    mesh = icosphere(1)
    assert mesh_topology.is_watertight(mesh) and mesh_topology.is_watertight(torus(sections=8))
    flipped = np.concatenate([mesh.faces[:1, ::-1], mesh.faces[1:]])
    for faces in (flipped, mesh.faces[1:], np.concatenate([mesh.faces, mesh.faces[:1]])):
        assert not mesh_topology.is_watertight(mesh_io.Mesh(mesh.vertices, faces))
    assert not mesh_topology.is_watertight(_unwelded(mesh))


def test_cones_that_touch_at_their_tips_are_not_a_manifold():
    apart = joined(*(moved(cube(0.5), 1.0, (at, at, at)) for at in (0.5, -0.5)))
    touching = mesh_topology._weld(apart, 0.0)
    assert len(touching.vertices) == 15 and mesh_topology.is_watertight(touching)
    assert not mesh_topology.has_manifold_vertices(touching) and mesh_topology.has_manifold_vertices(apart)
    assert mesh_topology.has_manifold_vertices(torus(sections=8))


def test_clean_welds_and_drops_without_moving_anything():
    mesh = icosphere(1)
    soup = _unwelded(mesh)
    worse = mesh_io.Mesh(soup.vertices, np.concatenate([soup.faces, soup.faces[:5, [1, 2, 0]], [[0, 0, 1], [3, 3, 3]]]))
    cleaned = mesh_topology.clean(worse)
    assert len(cleaned.vertices) == len(mesh.vertices) and len(cleaned.faces) == len(mesh.faces)
    assert mesh_topology.is_watertight(cleaned)
    assert set(map(tuple, cleaned.vertices)) == set(map(tuple, mesh.vertices))


def test_clean_welds_noisy_seams_only_if_that_closes_the_mesh():
    noisy = _unwelded(icosphere(2), noise=1e-6)
    assert mesh_topology.is_watertight(mesh_topology.clean(noisy))
    opened = mesh_io.Mesh(noisy.vertices, noisy.faces[2:])
    assert len(mesh_topology.clean(opened).vertices) == 3 * len(opened.faces)


def test_thin_parts_of_mixed_winding_survive_the_wrap():
    """Neighbours that run along their edge the same way once made whole panels vanish."""
    panel, rng = _plate((-1, -1, 0), (1, 1, 0), steps=9), _random()
    flips = rng.random(len(panel.faces)) < 0.5
    mixed = mesh_io.Mesh(panel.vertices, np.where(flips[:, None], panel.faces[:, ::-1], panel.faces))
    raw = joined(mixed, moved(cube(), np.array([0.02, 0.5, 0.02]), (0.9, -1.4, 0.1)))
    done = _prepared(raw)
    assert done.watertight and done.wrapped and done.lost == 0
    probes = done.field_from_raw.apply(raw.triangles.mean(axis=1))
    assert raycast.Scene(done.mesh).distance(probes).max() < 0.02
    assert not raycast.Scene(done.mesh).outside(probes).any()


def test_never_wrapped_meshes_keep_open_sheets_and_inner_parts():
    raw = joined(cube(), moved(icosphere(2), 0.3, (0.0, 0.0, 0.0)), _plate((-1, -1, 1.2), (1, 1, 1.2)))
    done = _prepared(raw, wrap="never")
    assert not done.wrapped and not done.watertight
    assert len(done.mesh.faces) == len(raw.faces)
    assert max(mesh_preparation.measure(raw, mesh_topology.clean(raw), 2000, _random()).values()) < 1e-5
    assert {getattr(done, name) for name in mesh_preparation.LOSSES} == {0.0}


def test_open_meshes_are_decimated_too():
    ball = icosphere(4)
    bowl = mesh_io.Mesh(ball.vertices, ball.faces[ball.triangles[:, :, 1].max(axis=1) < 0])
    small = mesh_preparation.decimate(bowl, 200)
    assert 0 < len(small.faces) <= 200 and not mesh_topology.is_watertight(small)
    assert raycast.Scene(bowl).distance(small.vertices).max() < 0.05


def test_wrap_encloses_the_soup_within_its_offset():
    parts = moved(cube(), 0.5, (0.4, 0, 0)), moved(icosphere(2), 0.6, (-0.3, 0, 0))
    raw = joined(*parts, _plate((-1, 0.2, -1), (1, 0.2, 1)))
    wrap = mesh_preparation.close(raw, alpha=0.03, offset=0.004)
    scene = raycast.Scene(wrap)
    assert mesh_topology.is_watertight(wrap) and mesh_topology.has_manifold_vertices(wrap)
    assert not scene.outside(raw.vertices).any()
    assert raycast.Scene(raw).distance(wrap.vertices).max() < 0.05 * raw.diagonal()


def test_hidden_inner_parts_vanish_and_are_reported():
    raw = joined(icosphere(3), moved(icosphere(2), 0.3, (0, 0, 0)))
    done = _prepared(raw)
    radii = np.linalg.norm(done.mesh.vertices, axis=1)
    assert radii.min() > 0.9
    assert 0.6 < done.hausdorff_hidden * raw.diagonal() < 0.75
    assert done.hausdorff_seen < 0.01 and done.mean_distance_seen < 0.005
    assert done.hausdorff >= done.hausdorff_hidden and done.mean_distance > 0.01  # with the ball
    assert "away from the raw mesh" in done.verdict and "hidden" in done.verdict


def test_wrap_and_decimation_keep_the_offset_error():
    raw = mesh_io.Mesh(icosphere(3).vertices, icosphere(3).faces[5:])
    errors = [_prepared(raw, offset=offset).mean_distance for offset in (0.008, 0.004, 0.002)]
    assert errors[0] > errors[1] > errors[2]
    assert 0.5 * 0.008 < errors[0] < 1.5 * 0.008


@pytest.mark.parametrize("faces", [2000, 500])
@pytest.mark.parametrize("mesh", [icosphere(5), torus(sections=60)], ids=["sphere", "torus"])
def test_decimation_reaches_its_bound_and_stays_closed(mesh, faces):
    small = mesh_preparation.decimate(mesh, faces)
    assert len(small.faces) <= faces
    assert mesh_topology.is_watertight(small) and mesh_topology.has_manifold_vertices(small)
    euler = [len(each.vertices) - len(each.faces) // 2 for each in (mesh, small)]
    assert euler[0] == euler[1]  # as many holes
    assert mesh_preparation.measure(mesh, small, 2000, _random())["hausdorff"] < 12 / faces


def test_decimation_that_cannot_stay_closed_says_so():
    block = trimesh.creation.annulus(0.5, 1.0, 1.0, sections=8)
    torus_like = mesh_io.Mesh(np.array(block.vertices), np.array(block.faces))
    with pytest.raises(checks.InputError, match="stay closed"):
        mesh_preparation.decimate(torus_like, 6)


def test_measured_distances_equal_closed_form_for_concentric_spheres():
    raw, result = icosphere(5), moved(icosphere(5), 0.9, (0, 0, 0))
    figures = mesh_preparation.measure(raw, result, 4000, _random())
    expected = 0.1 / (2 * np.sqrt(3))
    for name in ("hausdorff", "mean_distance", "lost"):
        assert_close(figures[name], np.array(expected), atol=2e-4)
    assert figures["hausdorff_hidden"] == 0
    assert mesh_preparation.measure(result, raw, 4000, _random())["lost"] == 0


@pytest.mark.real
@pytest.mark.parametrize(
    "name", ["eyeglasses.stl", "chair_kaykit_A.obj", "hard_winding_wallclock.stl", "cad_featuretype_unwelded.stl"]
)
def test_real_thin_and_broken_meshes_keep_their_parts(shared_dir, name):
    done = _prepared(mesh_io.load(shared_dir / "meshes" / name))
    assert done.watertight and len(done.mesh.faces) <= mesh_preparation.MeshesConfig().faces
    assert done.lost < 1e-3 and done.hausdorff_seen < 0.03 and done.mean_distance_seen < 0.003


@pytest.mark.real
@pytest.mark.slow
def test_every_readable_real_mesh_becomes_watertight(shared_dir):
    every = sorted((shared_dir / "meshes").iterdir())
    paths = [path for path in every if path.suffix in mesh_io.SUFFIXES and "bad_" not in path.name]
    assert len(paths) == 24
    for path in paths:
        done = _prepared(mesh_io.load(path))
        assert done.watertight and mesh_topology.has_manifold_vertices(done.mesh), path.name
        assert len(done.mesh.faces) <= 10_000, path.name
        assert done.lost < 0.003 and done.mean_distance_seen < 0.005, path.name


def _gear(corners: int = 600, teeth: int = 50) -> mesh_io.Mesh:
    """A flat toothed ring as CAD makes it: long thin triangles, sharp edges, flat sides on a common plane."""
    ring = trimesh.creation.annulus(0.7, 1.0, 0.2, sections=corners)
    vertices = np.array(ring.vertices)
    radius, turn = np.hypot(*vertices[:, :2].T), np.arctan2(vertices[:, 1], vertices[:, 0]) / np.pi
    vertices[(radius > 0.85) & (np.floor(turn * teeth + 0.01) % 2 == 1), :2] *= 0.9
    return mesh_io.Mesh(vertices, np.array(ring.faces))


@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize(
    ("scale", "shift"), [(1.0, (0, 0, 0)), (37.3, (1e3, -2e3, 7.0)), (1e-3, (5.0, 5.0, 5.0)), (1e6, (1e9, 0, 0))]
)
def test_closed_cad_part_is_kept_at_any_scale_place_and_rounding(scale, shift, single):
    raw = moved(_gear(), scale, shift)
    assert mesh_topology.is_watertight(raw) and len(raw.faces) == 4800
    if single:
        raw = mesh_io.Mesh(raw.vertices.astype(np.float32).astype(np.float64), raw.faces)
    done = _prepared(raw)
    assert not done.wrapped and done.watertight and len(done.mesh.faces) == 4800
    assert done.verdict == "kept as it is" and done.hausdorff == 0


def test_only_crossings_deeper_than_the_tolerance_count():
    box, turn = cube(), np.linalg.qr(_random().normal(size=(3, 3)))[0]
    lid = (box.triangles[:, :, 1] == 1).all(axis=1)
    rim = np.array([[-1.0, 1, -1], [-1, 1, 1], [1, 1, 1], [1, 1, -1]])
    corner = [int(np.argmin(np.abs(box.vertices - point).sum(axis=1))) for point in rim]
    roof = np.stack([corner, np.roll(corner, -1), np.full(4, 8)], axis=1)
    for depth, broken in ((-1e-3, False), (1e-6, False), (1e-3, True), (0.1, True)):
        tip = np.array([[0.1, -1 - depth * box.diagonal(), 0.2]])  # a pit from the lid down to the floor, or through it
        pit = mesh_io.Mesh(np.concatenate([box.vertices, tip]), np.concatenate([box.faces[~lid], roof]))
        assert mesh_topology.is_watertight(pit)
        assert (len(mesh_topology.pierced(pit)) > 0) == broken
        turned = mesh_io.Mesh(1e5 * pit.vertices @ turn.T + 3e6, pit.faces)
        assert (len(mesh_topology.pierced(turned)) > 0) == broken


def test_closed_pieces_that_lie_apart_are_kept_and_turned_outwards_one_by_one():
    inwards = _inside_out(icosphere(2))
    done = _prepared(joined(inwards, moved(cube(), 1.0, (3.0, 0, 0))))
    assert not done.wrapped and (mesh_topology.volumes(done.mesh) > 0).all()
    assert _prepared(joined(inwards, moved(cube(), 1.0, (1.5, 0, 0)))).wrapped


RING = torus(0.5, 0.1, 24)
ACROSS = mesh_io.Mesh(RING.vertices[:, [0, 2, 1]] + np.array([0.5, 0, 0]), RING.faces[:, ::-1])
TOGETHER = {  # pieces whose boxes meet, and how many lie inside others; None: not kept
    "rings": ((RING, ACROSS), 0),
    "cavity": ((cube(), _inside_out(cube(0.5))), 1),
    "body in a cavity": ((cube(), _inside_out(cube(0.5)), cube(0.2)), 2),
    "solid in a solid": ((cube(), cube(0.5)), None),
    "touching": ((cube(), moved(cube(0.5), 1.0, (1.5, 0.3, 0.2))), None),
    "crossing": ((cube(), moved(cube(0.5), 1.0, (1.2, 0.3, 0.2))), None),
}


@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize("name", TOGETHER)
def test_closed_pieces_whose_boxes_meet_are_kept_unless_their_surfaces_do(name, inside_out):
    parts, held = TOGETHER[name]
    raw = joined(*parts)
    volume = mesh_topology.volumes(raw).sum()
    done = _prepared(_inside_out(raw) if inside_out else raw)
    assert done.wrapped == (held is None) and done.watertight
    if held is not None:
        assert len(done.mesh.faces) == len(raw.faces) and done.hausdorff == 0
        assert mesh_topology.volumes(done.mesh).sum() == pytest.approx(volume * done.field_from_raw.scale**3)
        assert (f"{held} of its parts lie inside others" in done.verdict) == (held > 0)


def test_closed_meshes_that_flat_triangles_or_pairs_hold_together_are_kept():
    box, plate = cube(), _plate((-1, -1, 0), (1, 1, 0))
    middle = box.vertices[box.faces[0, [0, 1]]].mean(axis=0)  # cut one side of an edge alone: a flat triangle closes it
    a, b, c = box.faces[0]
    faces = np.concatenate([box.faces[1:], [[a, 8, c], [8, b, c], [a, b, 8]]])
    split = mesh_io.Mesh(np.concatenate([box.vertices, middle[None]]), faces)
    assert mesh_topology.is_watertight(split) and mesh_topology.is_watertight(mesh_topology.clean(split))
    paired = mesh_io.Mesh(box.vertices, np.concatenate([box.faces, [[0, 1, 2], [2, 1, 0]]]))
    cleaned = mesh_topology.clean(paired)
    assert mesh_topology.is_watertight(cleaned) and len(cleaned.faces) == 12
    doubled = mesh_io.Mesh(plate.vertices, np.concatenate([plate.faces, plate.faces[:, ::-1]]))
    assert len(mesh_topology.clean(doubled).faces) == len(plate.faces)  # a sheet given from both sides stays


def test_open_scan_is_a_thin_shell_and_says_so_and_filling_its_opening_makes_a_solid():
    ball = icosphere(3)
    bowl = mesh_io.Mesh(ball.vertices, ball.faces[ball.triangles[:, :, 1].max(axis=1) < 0.3])
    shell = _prepared(bowl)
    assert shell.wrapped and shell.watertight and mesh_preparation.thickness(shell.mesh) < 0.005
    assert "a thin shell" in shell.verdict and "1 openings" in shell.verdict and "--close holes" in shell.verdict
    solid = _prepared(bowl, holes=True)
    assert not solid.wrapped and solid.watertight and solid.openings_filled == 1
    assert mesh_preparation.thickness(solid.mesh) > 0.15 and "thin shell" not in solid.verdict


def test_loss_counts_vertices_and_sharp_edges_that_points_by_area_miss():
    spike = mesh_io.Mesh(np.array([[0, 0, 0], [0, 1e-6, 0], [0.5, 0, 1e-7]]), np.array([[0, 1, 2]]))
    ball = moved(icosphere(3), 0.1, (0, 0, 0))
    figures = mesh_preparation.measure(joined(ball, spike), ball, 2000, _random())
    expected = 0.4 / joined(ball, spike).diagonal()
    assert_close(figures["hausdorff"], np.array(expected), rtol=1e-3)
    assert_close(figures["lost"], np.array(expected), rtol=1e-3)
    assert figures["hausdorff_seen"] < 0.05  # points by area miss the spike, which is why it is not the whole truth

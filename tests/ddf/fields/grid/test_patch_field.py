"""Patches against closed forms, a slow search along the ray, the paper's properties, and shapes that break grids."""

import numpy as np
import pytest
from _shapes import cube, icosphere, moved, torus

import ddf
from ddf.api.field import Field
from ddf.core import checks
from ddf.data.synthetic import showcase
from ddf.fields import framed_field
from ddf.fields.grid import kernels, octree, patch_field
from ddf.fit import fit_folder, surfaces
from ddf.geometry import raycast, rays
from ddf.geometry.mesh_io import Mesh

EVERYTHING = patch_field.OUTPUTS
FINE = octree.PatchConfig()


def field_of(mesh: Mesh, config: octree.PatchConfig = FINE) -> patch_field.PatchField:
    return patch_field.of(*patch_field.fitted(*fit_folder.in_cube(mesh), config))


def random_rays(count: int, half: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    directions = random.standard_normal((count, 3))
    return random.uniform(-half, half, (count, 3)), directions / np.linalg.norm(directions, axis=1, keepdims=True)


def ask(field: patch_field.PatchField, positions, directions) -> dict[str, np.ndarray]:
    points = rays.OrientedPoints(np.array(positions, float), np.array(directions, float))
    return framed_field.query(field, points, EVERYTHING)[0]


@pytest.fixture(scope="module")
def ball() -> patch_field.PatchField:
    return field_of(icosphere(5))


@pytest.fixture(scope="module")
def block() -> patch_field.PatchField:
    return field_of(cube())


def test_depth_normals_and_curvatures_of_a_sphere(ball):
    positions, directions = random_rays(4000, 1.0)
    found = ask(ball, positions, directions)
    along = (positions * directions).sum(axis=1)
    inside = np.linalg.norm(positions, axis=1) < 0.99
    root = along**2 + 1 - (positions**2).sum(axis=1)
    steep = (root > 0.1) & (inside | (np.linalg.norm(positions, axis=1) > 1.01))
    truth = np.where(inside, 1, -1) * np.sqrt(np.maximum(root, 0)) - along
    seen = steep & (inside | (along < 0))
    assert (found["visibility"][steep] == seen[steep]).all()
    assert np.abs(found["depth"][seen] - truth[seen]).max() < 2e-3
    normals = (positions + truth[:, None] * directions) * np.where(inside, -1, 1)[:, None]
    angle = np.degrees(np.arccos(np.clip((found["normals"] * normals).sum(axis=1), -1, 1)))[seen]
    assert np.median(angle) < 0.5 and angle.max() < 5
    mean, gaussian = (found[f"{name}_curvature"][seen] for name in ("mean", "gaussian"))
    assert np.median(np.abs(mean - np.where(inside, 2, -2)[seen])) < 0.1 * 2
    assert np.median(np.abs(gaussian - 1)) < 0.1


def test_a_box_is_exact_to_the_rounding_of_its_file(block):
    positions, directions = random_rays(4000, 1.5)
    truth = raycast.cast(cube(), rays.OrientedPoints(positions, directions))
    found = ask(block, positions, directions)
    far = ~np.isclose(np.abs(positions), 1, atol=1e-3).any(axis=1)
    agree = (found["visibility"] > 0.5) == truth.visible
    assert agree[far].mean() > 0.999
    both = (found["visibility"] > 0.5) & truth.visible
    assert np.quantile(np.abs(found["depth"][both] - truth.depth[both]), 0.99) < 1e-4
    assert np.quantile((found["normals"] * truth.normals).sum(axis=1)[both], 0.01) > 0.9999
    arrays, _ = patch_field.fitted(*fit_folder.in_cube(cube()), FINE)
    assert sum(array.nbytes for array in arrays.values()) < 45_000


def test_a_plate_thinner_than_a_cell_keeps_both_sides():
    plate = moved(cube(), np.array([1.0, 0.002, 1.0]), (0.0, 0.0, 0.0))
    field = field_of(plate)
    positions = np.random.default_rng(0).uniform(-0.9, 0.9, (2000, 3))
    for side in (1.0, -1.0):
        positions[:, 1] = side * 0.5
        down = np.tile([0.0, -side, 0.0], (len(positions), 1))
        assert np.abs(ask(field, positions, down)["depth"] - 0.498).max() < 1e-5
    positions[:, 1] = 0.0
    between = ask(field, positions, np.tile([0.0, 1.0, 0.0], (len(positions), 1)))
    assert np.abs(between["depth"] - 0.002).max() < 1e-5


def test_the_properties_of_a_directed_distance_field_hold(ball):
    positions, directions = random_rays(1000, 0.5)
    found = ball.evaluate(positions, directions, EVERYTHING)
    depth, normals = found["depth"], found["normals"]
    step = 1e-5

    def depths(starts):
        return ball.evaluate(starts, directions, ("depth",))["depth"]

    moved_on = depths(positions + step * directions)
    assert np.allclose(moved_on, depth - step, atol=1e-9)  # I: v . ∇_p d = -1, exactly, whatever the patch
    both = ((depths(positions + step * axis), depths(positions - step * axis)) for axis in np.eye(3))
    gradient = np.stack([(ahead - behind) / (2 * step) for ahead, behind in both], axis=1)
    within = np.abs(gradient).max(axis=1) < 10  # the stencil stays in one cell
    assert within.mean() > 0.98
    slope = (normals * directions).sum(axis=1)
    predicted = -normals / slope[:, None]  # II, and the head's normal agrees with the gradient's
    off = np.linalg.norm(gradient - predicted, axis=1)
    assert np.quantile(off[within], 0.98) < 1e-4
    turn = np.cross(np.random.default_rng(1).standard_normal((1000, 3)), directions)
    turned = directions + step * turn
    change = ball.evaluate(positions, turned / np.linalg.norm(turned, axis=1, keepdims=True), ("depth",))["depth"]
    expected = depth * (predicted * turn).sum(axis=1)  # III: ∇_v d δ = d ∇_p d δ
    assert np.quantile(np.abs((change - depth) / step - expected)[within], 0.97) < 1e-3


def test_rays_equal_a_slow_search_through_all_patches(block):
    """Every patch of every cell, without an octree: the least root inside its cell that no other patch cuts off."""
    tree, (positions, directions) = block.tree, random_rays(200, 0.9, seed=3)
    first = np.maximum.accumulate(np.where(np.r_[True, tree.codes[:-1] & kernels.LAST], np.arange(len(tree.codes)), 0))
    least = np.full(len(positions), np.inf)
    for i, row in enumerate(tree.patches.astype(float)):
        assert (row[4:] == 0).all()
        start = positions - tree.centres[i]
        t = (row[3] - start @ row[:3]) / (directions @ row[:3])
        hit = start + t[:, None] * directions
        held = (t >= 0) & (np.abs(hit) <= tree.sides[i] / 2 + 1e-9).all(axis=1)
        for j in range(kernels.MOST):
            cut = tree.codes[i] >> (2 + 2 * j) & 3
            if cut:
                other = tree.patches[first[i] + j].astype(float)
                value = (hit @ other[:3] - other[3]) * (1 if cut == 1 else -1)
                held &= value >= -block.tolerance / 2 ** (tree.codes[i] >> kernels.FINENESS & kernels.FINEST)
        least = np.where(held, np.minimum(least, t), least)
    found = block.evaluate(positions, directions, ("depth", "visibility"))
    both = (found["visibility"] > 0) & np.isfinite(least)
    assert both.mean() > 0.97
    assert np.quantile(np.abs(found["depth"][both] - least[both]), 0.98) < 1e-9


@pytest.mark.parametrize("mesh", [icosphere(4), cube(), torus()], ids=["sphere", "cube", "torus"])
def test_rays_that_start_on_the_surface_do_not_meet_it_there(mesh):
    random, field = np.random.default_rng(5), field_of(mesh)
    corners = mesh.triangles[random.integers(0, len(mesh.faces), 4000)]
    starts = np.einsum("ni,nij->nj", random.dirichlet(np.ones(3), 4000), corners)
    directions = random_rays(4000, 1.0, seed=6)[1]
    scene = raycast.Scene(mesh)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lift = np.copysign(raycast.SURFACE_OFFSET, (normals * directions).sum(axis=1))
    truth = scene.first_hits(starts + lift[:, None] * normals, directions)[0]
    found = ask(field, starts, directions)["depth"]
    assert (np.isfinite(found) != np.isfinite(truth)).mean() < 0.01


def test_axis_parallel_and_diagonal_rays_along_cell_borders(block):
    starts = np.array([[-3.0, 0.0, 0.0], [0.0, -3.0, 0.5], [-3.0, -3.0, 0.0], [-3.0, -3.0, -3.0], [0.0, 0.0, 0.0]])
    ways = np.array([[1.0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 1, 1], [0, 0, -1]])
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    assert np.allclose(ask(block, starts, ways)["depth"], [2, 2, 2 * 2**0.5, 2 * 3**0.5, 1], atol=1e-3)
    assert np.isinf(ask(block, [[-3.0, 1.001, 0.0], [0.0, 0.0, 3.0]], [[1, 0, 0], [0, 0, 1]])["depth"]).all()


@pytest.mark.parametrize("away", [999.0, 1e3 + 1, 1e6, 1e8, 1e12])
def test_rays_from_far_away_meet_what_near_ones_meet(ball, away):
    positions, directions = random_rays(300, 0.5, seed=8)
    starts = positions - away * directions
    near, far = (ask(ball, each, directions)["depth"] for each in (positions - 3 * directions, starts))
    rounded = np.abs(starts + away * directions - positions).max() + 1e-16 * away
    assert np.abs(far - near - away + 3).max() < 1e-9 + 10 * rounded


def test_a_mesh_far_away_and_flat_triangles_change_nothing():
    shape = icosphere(3)
    flat = Mesh(np.concatenate([shape.vertices, [[9.0, 9, 9]]]), np.concatenate([shape.faces, [[642, 642, 642]]]))
    far = moved(flat, 30.0, (5e5, -2e5, 1e5))
    positions, directions = random_rays(500, 0.8)
    near = ask(field_of(shape), positions, directions)
    found = ask(field_of(far), 30 * positions + [5e5, -2e5, 1e5], directions)
    both = (near["visibility"] > 0) & (found["visibility"] > 0)
    assert (near["visibility"] == found["visibility"]).mean() > 0.99 and both.mean() > 0.5
    assert np.quantile(np.abs(found["depth"][both] / 30 - near["depth"][both]), 0.99) < 1e-5


def test_no_rays_and_no_surface(block):
    assert block.evaluate(np.zeros((0, 3)), np.zeros((0, 3)), EVERYTHING)["normals"].shape == (0, 3)
    with pytest.raises(checks.InputError, match="no triangle with an area"):
        octree.build(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])), FINE)


def test_closer_patches_come_closer_until_they_run_out():
    shape, errors, sizes = torus(sections=192), [], []
    positions, directions = random_rays(3000, 0.9, seed=2)
    truth = raycast.cast(shape, rays.OrientedPoints(positions, directions))
    for config in (octree.PatchConfig(1e-3), octree.PatchConfig(2e-4)):
        field = field_of(shape, config)
        found = ask(field, positions, directions)
        both = (found["visibility"] > 0) & truth.visible
        errors.append(np.median(np.abs(found["depth"][both] - truth.depth[both])))
        sizes.append(len(field.tree.codes))
    assert errors[0] > 2 * errors[1] and sizes[0] < sizes[1]
    few = field_of(shape, octree.PatchConfig(2e-4, patches=sizes[0]))
    assert len(few.tree.codes) < 1.5 * sizes[0]


def test_points_lie_evenly_on_the_surface_and_distances_are_those_of_the_mesh(ball):
    points = ball.points(5000, seed=1)
    assert np.abs(np.linalg.norm(points, axis=1) - 1).max() < 3e-3
    assert np.abs(points.mean(axis=0)).max() < 0.01 and np.allclose((points**2).mean(axis=0), 1 / 3, atol=0.01)
    assert not np.array_equal(points, ball.points(5000, seed=2))
    asked = random_rays(2000, 1.0)[0]
    distances, ways = ball.cloud().distances(asked)
    assert np.abs(distances - np.abs(1 - np.linalg.norm(asked, axis=1))).max() < 5e-3
    assert np.abs(np.linalg.norm(asked + distances[:, None] * ways, axis=1) - 1).max() < 5e-3
    with pytest.raises(checks.InputError, match="must be >= 1; got 0"):
        ball.points(0)


def test_distances_of_a_chair_and_of_a_room_with_a_rabbit_are_exact_to_a_thousandth():
    half, where = 0.5, (0.0, -0.74, 0.0)
    parts = [Field(field_of(make())) for make in (showcase.room, showcase.rabbit)]
    place = np.diag([half, half, half, 1.0])
    place[:3, 3] = where
    chair = showcase.SHAPES["armchair"]()
    room = showcase.furnished(half, where), ddf.compose(parts, [np.eye(4), place])
    for mesh, shape in ((chair, Field(field_of(chair))), room):
        low, high = mesh.box()
        positions = np.random.default_rng(0).uniform(low, high, (4000, 3))
        distances, ways = shape.udf(positions)
        truth = raycast.Scene(mesh).closest(positions) - positions
        exact = np.linalg.norm(truth, axis=1)
        assert np.abs(distances - exact).mean() < 2e-3 * (high - low).max() / 2
        cosine = (ways * truth).sum(axis=1) / np.maximum(exact, 1e-12)
        assert np.degrees(np.arccos(np.clip(cosine, -1, 1)))[exact > 1e-3].mean() < 3


def test_curvatures_of_a_torus_are_those_of_its_closed_form():
    """-1/r along the tube's circle, -cos θ / (R + r cos θ) around the axis, which is positive on the inner half."""
    mesh, (major, minor) = torus(sections=256), (0.7, 0.3)
    positions, directions = random_rays(3000, 0.99)
    truth = raycast.cast(mesh, rays.OrientedPoints(positions, directions))
    found = ask(field_of(mesh), positions, directions)
    grazing = np.abs((truth.normals * directions).sum(axis=1)) < 0.1
    seen = truth.visible & (found["visibility"] > 0) & ~grazing
    seen[seen] = np.abs(found["depth"][seen] - truth.depth[seen]) < 0.02
    assert seen.mean() > 0.35
    ring = np.hypot(*(positions + truth.depth[:, None] * directions)[seen][:, [0, 2]].T)
    inside = np.hypot(np.hypot(*positions[seen][:, [0, 2]].T) - major, positions[seen, 1]) < minor
    around, cosine = -1 / minor, (ring - major) / minor
    mean = (around - cosine / ring) * np.where(inside, -1, 1)
    gaussian = -around * cosine / ring
    assert np.median(np.abs(found["mean_curvature"][seen] - mean) / np.abs(mean)) < 0.1
    assert np.median(np.abs(found["gaussian_curvature"][seen] - gaussian) / np.abs(gaussian)) < 0.1


def test_a_part_of_the_cloud_is_of_all_the_shape_and_gives_its_surface(ball):
    cloud = ball.cloud()
    assert np.abs(cloud.hits[:2000].mean(axis=0)).max() < 0.05
    mesh = surfaces.extract(ball, cloud, "poisson", 2000)
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 1).max() < 0.01

"""Fields from posed depth images, beside what is made of them elsewhere, in no more CPU time: novel views, inner rays.

32 pinhole cameras of 160 x 120 pixels around an object or in a room; ranges clean, or with a deviation of 1 %.
`patches` is `ddf fit` of the rays, `network` that of noisy rays with 1,000 steps; `of the mesh` are those of the truth.
Rivals' meshes are cast by Open3D: its scalable TSDF (VoxelBlockGrid: ScalableTSDFVolume of version 0.20 reads depths as
millimetres and stays empty), its screened Poisson and its alpha shapes of the points; of several settings each, of
those that take no longer than the patches, the one with the fewest wrong inner rays, which a user could not know. The
last lines are of the first object from fewer and more views, with 2 % of outliers. Depths are along the
rays of 8 novel views; `wrong_inner` are percents of rays that begin where some camera saw free space, any way, whose
visibility is wrong or whose depth is off by more than 0.02; `wrong_seen` of those that `Field.seen` vouches for.
Lengths are in halves of the longest side.

Patches lose where parts are thinner than the noise, as wings of the airliner: planes of hits need a width of some
deviations, and a TSDF does not smooth across a part. Poisson has fewer wrong inner rays in noisy rooms, and by little
of the clean airliner and furnished room. Of clean objects, patches are 3 to 400 times farther off than those of the
mesh, by the median: flat faces are exact there, while hits, one a pixel, round each edge by a cell of the grid, 1/160
of the longest side at most. The mug's inside is seen by few: from clean depth all rivals have fewer wrong rays there.
"""

import functools
import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.data import ray_casting
from bench.fields import fits
from bench.lib import measuring
from ddf.data.synthetic import showcase
from ddf.fields import framed_field
from ddf.fields.grid import octree, patch_field
from ddf.fit import fit_folder, inspection, patch_fitting
from ddf.geometry import fused_rays, mesh_io, raycast, rays, scans, sensors, unsigned_surface

OBJECTS = ("spot_23k.obj", "chair_kaykit_A.obj", "mug.stl", "teapot.obj", "airplane_airliner.obj")
HEIGHT, WIDTH, VIEWS, NOVEL, NOISES, INNER, TRIED, OFF = 120, 160, 32, 8, (0.01, 0.0), 20_000, 50_000, 0.02
LINES = ("patches", "TSDF", "Poisson", "alpha shapes", "network", "network of the mesh", "patches of the mesh")
HALL = (  # files, halves of the longest sides, places on the floor
    ("chair/ikea-manuals__Chair_kaustby.ply", 0.35, -0.5, -0.5),
    ("chair/gazebo-collection__office_chair.ply", 0.4, 0.5, -0.5),
    ("chair/kaykit-furniture__couch.ply", 0.45, -0.4, 0.5),
    ("car/kenney__CarKit_Sedan.ply", 0.35, 0.5, 0.45),
)
FEW_AND_MANY, OUTLIERS = (4, 8, 128, 256), 0.02
STEPS = 1000  # of the network
INTRINSICS = sensors.default_intrinsics(HEIGHT, WIDTH)
VOXELS, TRUNCATIONS, DEPTHS, ALPHAS = (0.0075, 0.01, 0.015, 0.02, 0.03, 0.04), (3.0, 5.0, 8.0), (6, 7), (0.06, 0.1)
_FAR = 50.0  # depth of what is not there, for rivals that know no infinity

Ask = Callable[[np.ndarray, np.ndarray], np.ndarray]


def facing(eye: np.ndarray, target: np.ndarray) -> np.ndarray:
    """The pose of a camera that looks at a point, (4, 4), Z ahead, Y down."""
    ahead = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(ahead, [0, 1, 0] if abs(ahead[1]) < 0.95 else [1, 0, 0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack([right, np.cross(ahead, right), ahead], axis=1), eye
    return pose


def around(mesh: mesh_io.Mesh, count: int, seed: int) -> list[np.ndarray]:
    """Poses from all sides, from which the box is seen whole."""
    lower, upper = mesh.box()
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    away = 1.05 * np.linalg.norm(upper - lower) / 2 / np.sin(np.radians(25))
    return [facing((lower + upper) / 2 + away * way, (lower + upper) / 2) for way in rays.evenly_spread(count) @ turn]


def within(mesh: mesh_io.Mesh, count: int, seed: int) -> list[np.ndarray]:
    """Poses in free places of a room, looking anywhere in it."""
    scene, random, poses = raycast.Scene(mesh), np.random.default_rng(seed), []
    lower, upper = mesh.box()
    while len(poses) < count:
        eye, target = random.uniform(0.85 * lower, 0.85 * upper), random.uniform(0.7 * lower, 0.7 * upper)
        if scene.distance(eye[None])[0] > 0.2 and np.linalg.norm(target - eye) > 0.3:
            poses.append(facing(eye, target))
    return poses


@dataclass(frozen=True)
class Case:
    """What cameras saw of a shape, and the rays that all are asked."""

    scene: raycast.Scene
    poses: list[np.ndarray]
    scan: scans.Scan
    novel: scans.Scan
    inner: scans.Scan


def look(scene: raycast.Scene, poses: list[np.ndarray], noise: float, outliers: float = 0.0) -> scans.Scan:
    """All pixels of cameras, row by row; outliers: share of hits whose range is any up to twice the true one."""
    along = scans.pixel_directions(HEIGHT, WIDTH, INTRINSICS)
    starts = np.repeat([pose[:3, 3] for pose in poses], len(along), axis=0)
    ways = np.concatenate([along @ pose[:3, :3].T for pose in poses])
    depth = scene.first_hits(starts, ways)[0]
    random = np.random.default_rng(0)
    seen = depth * (1 + noise * random.normal(size=len(depth)))
    stray = random.random(len(depth)) < outliers
    return scans.Scan(starts, ways, np.where(stray, depth * random.uniform(0.01, 2, len(depth)), seen))


def inner(scene: raycast.Scene, poses: list[np.ndarray]) -> scans.Scan:
    """Rays of all directions from where some camera saw free space."""
    random, seen = np.random.default_rng(9), np.zeros(TRIED, bool)
    starts = random.uniform(*scene.mesh.box(), (TRIED, 3))
    for pose in poses:
        local = (starts - pose[:3, 3]) @ pose[:3, :3]
        pixel = local[:, :2] / local[:, 2:] * INTRINSICS[0, 0]
        left = np.flatnonzero(~seen & (local[:, 2] > 0) & (np.abs(pixel) < [WIDTH / 2, HEIGHT / 2]).all(axis=1))
        length = np.linalg.norm(local[left], axis=1)
        back = (pose[:3, 3] - starts[left]) / length[:, None]
        seen[left] = scene.first_hits(starts[left], back)[0] > length
    starts = starts[seen][:INNER]
    ways = random.normal(size=starts.shape)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return scans.Scan(starts, ways, scene.first_hits(starts, ways)[0])


def errors(ask: Ask, case: Case) -> dict[str, float]:
    """Against the truth."""
    depth, truth = ask(case.novel.positions, case.novel.directions), case.novel.ranges
    both, either = np.isfinite(depth) & np.isfinite(truth), np.isfinite(depth) | np.isfinite(truth)
    off = np.abs(depth[both] - truth[both])
    wrong = inspection.wrong(ask(case.inner.positions, case.inner.directions), case.inner.ranges, OFF)
    return {
        "depth_median": float(np.median(off)) if both.any() else np.nan,
        "depth_mean": float(off.mean()) if both.any() else np.nan,
        "silhouettes": float(both.sum() / either.sum()),
        "wrong_inner": 100 * float(wrong.mean()),
    }


def _timed(make: Callable[[], Any]) -> tuple[Any, float]:
    started = time.process_time()
    return make(), time.process_time() - started


def of_mesh(mesh: mesh_io.Mesh) -> Ask:
    """What is met on a mesh."""
    scene = raycast.Scene(mesh)
    return lambda starts, ways: scene.first_hits(starts, ways)[0]


def of_field(field: framed_field.FramedField) -> Ask:
    """What a field says."""
    return lambda starts, ways: framed_field.query(field, rays.OrientedPoints(starts, ways), ("depth",))[0]["depth"]


def patches(scan: scans.Scan) -> patch_field.PatchField:
    """As `ddf fit` makes them of rays."""
    return patch_field.of(*patch_fitting.of_fused(fused_rays.fuse(scan)))


def rivals(case: Case) -> Iterator[tuple[str, dict[str, Any], Callable[[], mesh_io.Mesh]]]:
    """Name, setting, and what makes the mesh."""
    for voxel, truncation in itertools.product(VOXELS, TRUNCATIONS):
        yield "TSDF", {"voxel": voxel, "truncation": truncation}, functools.partial(tsdf, case, voxel, truncation)
    for depth in DEPTHS:
        yield "Poisson", {"depth": depth}, functools.partial(poisson, case, depth)
    for alpha in ALPHAS:
        yield "alpha shapes", {"alpha": alpha}, functools.partial(alpha_shape, case, alpha)


def tsdf(case: Case, voxel: float, truncation: float) -> mesh_io.Mesh:
    """Open3D's scalable TSDF; truncation: in voxels."""
    import open3d as o3d

    core, along = o3d.core, scans.pixel_directions(HEIGHT, WIDTH, INTRINSICS)[:, 2]
    kinds, shapes = (core.float32, core.float32), ((1), (1))
    grid = o3d.t.geometry.VoxelBlockGrid(("tsdf", "weight"), kinds, shapes, voxel, 8, 20_000, core.Device("CPU:0"))
    centred = core.Tensor(INTRINSICS - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])
    for pose, ranges in zip(case.poses, case.scan.ranges.reshape(len(case.poses), -1), strict=True):
        depth = np.where(np.isfinite(ranges), ranges * along, 0).astype(np.float32).reshape(HEIGHT, WIDTH)
        image, extrinsic = o3d.t.geometry.Image(core.Tensor(depth)), core.Tensor(np.linalg.inv(pose))
        blocks = grid.compute_unique_block_coordinates(image, centred, extrinsic, 1.0, 2 * _FAR, truncation)
        grid.integrate(blocks, image, centred, extrinsic, 1.0, 2 * _FAR, truncation)
    found = grid.extract_triangle_mesh(weight_threshold=0.0)
    return mesh_io.Mesh(found.vertex.positions.numpy(), found.triangle.indices.numpy())


def _cloud(case: Case, spacing: float) -> Any:
    """Hits so far apart, with the ways to their cameras as normals."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(case.scan.points))
    cloud.normals = o3d.utility.Vector3dVector(-case.scan.directions[case.scan.hit])
    return cloud.voxel_down_sample(spacing)


def poisson(case: Case, depth: int) -> mesh_io.Mesh:
    """Screened Poisson of hits as far apart as its cells, with normals that face the cameras."""
    import open3d as o3d

    cloud = _cloud(case, 2 / 2**depth)
    ways = np.asarray(cloud.normals).copy()
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
    normals = np.asarray(cloud.normals)
    normals = normals * np.where((normals * ways).sum(1) < 0, -1.0, 1.0)[:, None]
    return unsigned_surface.poisson(np.asarray(cloud.points), normals, depth)


def alpha_shape(case: Case, alpha: float) -> mesh_io.Mesh:
    """Alpha shape of hits that are half of alpha apart."""
    import open3d as o3d

    found = o3d.geometry.TriangleMesh.create_from_point_cloud_alpha_shape(_cloud(case, alpha / 2), alpha)
    return mesh_io.Mesh(np.asarray(found.vertices), np.asarray(found.triangles))


def hall() -> mesh_io.Mesh:
    """A room with shapes of other people on its floor, those that are there."""
    room, folder = showcase.room(), measuring.REAL_MESHES.parent / "shapes"
    vertices, faces, count = [room.vertices], [room.faces], len(room.vertices)
    for file, size, x, z in HALL:
        if (folder / file).is_file():
            mesh = fit_folder.in_cube(mesh_io.load_surface(folder / file))[0]
            vertices.append(size * mesh.vertices + [x, -size * mesh.box()[0][1] - 0.999, z])
            faces.append(mesh.faces + count)
            count += len(mesh.vertices)
    return mesh_io.Mesh(np.concatenate(vertices), np.concatenate(faces))


def shapes() -> dict[str, tuple[mesh_io.Mesh, Callable[..., list[np.ndarray]]]]:
    """By name: the mesh in [-1, 1]³, and where its cameras stand. Synthetic objects where no others are there."""
    objects = fits.real(OBJECTS) or fits.made()
    found = {name: (fit_folder.in_cube(mesh)[0], around) for name, mesh in objects.items()}
    rooms = {"furnished room": showcase.furnished(0.5, (0, -0.5, 0)), "hall": hall()}
    return found | {name: (fit_folder.in_cube(mesh)[0], within) for name, mesh in rooms.items()}


def main() -> measuring.Rows:
    """Every shape, clean and noisy, by every way."""
    ball = raycast.Scene(ray_casting.sphere(1000))
    patches(look(ball, around(ball.mesh, 8, 1), 0.01))  # compiles
    for noise, (name, (mesh, stand)) in itertools.product(NOISES, shapes().items()):
        scene, poses = raycast.Scene(mesh), stand(mesh, VIEWS, 1)
        novel = look(scene, stand(mesh, NOVEL, 2), 0.0)
        yield from of_case(name, noise, Case(scene, poses, look(scene, poses, noise), novel, inner(scene, poses)))
    name, (mesh, stand) = next(iter(shapes().items()))
    scene, noise = raycast.Scene(mesh), NOISES[0]
    novel = look(scene, stand(mesh, NOVEL, 2), 0.0)
    for views in FEW_AND_MANY:
        poses = stand(mesh, views, 1)
        case = Case(scene, poses, look(scene, poses, noise, OUTLIERS), novel, inner(scene, poses))
        yield of_patches(case, {"shape": f"{name}, {views} views, outliers", "noise": noise})


def of_patches(case: Case, size: dict[str, Any]) -> measuring.Row:
    """What `ddf fit` makes of a scan."""
    field, took = _timed(lambda: patches(case.scan))
    seen = field.seen(case.inner.positions, case.inner.directions)
    ask = of_field(field)
    wrong = inspection.wrong(ask(case.inner.positions, case.inner.directions), case.inner.ranges, OFF)
    vouched = {"wrong_seen": 100 * float(wrong[seen].mean()), "seen_percent": 100 * float(seen.mean())}
    bytes_ = sum(values.nbytes for values in field.arrays.values())
    return {**measuring.row("patches", size, [took], {**errors(ask, case), **vouched}), "bytes": bytes_}


def of_case(name: str, noise: float, case: Case) -> measuring.Rows:
    """All ways for one scan."""
    size = {"shape": name, "noise": noise}
    yield (own := of_patches(case, size))
    best: dict[str, measuring.Row] = {}
    for way, setting, make in rivals(case):
        mesh, seconds = _timed(make)
        if seconds > own["median_s"] or not len(mesh.faces):
            continue
        row = measuring.row(way, size, [seconds], errors(of_mesh(mesh), case))
        row |= {"setting": setting, "bytes": 12 * (len(mesh.vertices) + len(mesh.faces))}
        if way not in best or row["error"]["wrong_inner"] < best[way]["error"]["wrong_inner"]:
            best[way] = row
    yield from best.values()
    for way, given in {"network": case.scan, "network of the mesh": case.scene.mesh}.items() if noise else ():
        fitted, seconds = _timed(functools.partial(fits.network, given, STEPS))
        row = measuring.row(way, size, [seconds], errors(of_field(fitted), case))
        yield {**row, "bytes": 4 * fitted.parameters}
    if noise == 0:
        of_truth, seconds = _timed(lambda: patch_fitting.patches(case.scene.mesh, octree.PatchConfig()))
        bytes_ = sum(values.nbytes for values in of_truth.arrays.values())
        row = measuring.row("patches of the mesh", size, [seconds], errors(of_field(of_truth), case))
        yield {**row, "bytes": bytes_}

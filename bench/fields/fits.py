"""Fields of one mesh by kind, beside the mesh itself: errors, bytes, and milliseconds of an image on one core.

Six meshes from outside, six made here, chosen for nothing, and a sphere of more and more triangles.

`sine` is the default network of `ddf fit --kind sine` after some steps; `patches`
is what `ddf fit` makes, by tolerance; `mesh` is Open3D's cast in float32 (Embree) and nothing else. Lengths are in
halves of the longest side. Images are 8 of 256 x 256 from outside; `thin` is the share of their points on parts thinner
than 2 % of the longest side that are seen within 1 % of it; `wrong` are percents of 50,000 rays, from inside the box or
from the surface, whose visibility is wrong or whose depth is off by more than 0.02. Bytes of a mesh are its corners and
triangles, without the caster's tree. All times are those of one core's work.
"""

import dataclasses
import itertools
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh

from bench.data import ray_casting
from bench.lib import measuring
from ddf.data.synthetic import assemble, cars, chairs, planes
from ddf.fields import framed_field, shape_field
from ddf.fields.grid import octree, patch_field
from ddf.fit import fit_folder, fit_settings, fitting, inspection
from ddf.geometry import mesh_io, raycast, rays, scans
from ddf_lab.report import beside

REAL = (
    "spot_23k.obj",
    "chair_kaykit_A.obj",
    "hard_nested_dishwasher.stl",
    "teapot.obj",
    "airplane_airliner.obj",
    "eyeglasses.stl",
)
STEPS, TOLERANCES, GROWING = 1500, (3e-4, 1e-3), (1_000, 10_000, 100_000, 1_000_000)
RAYS, SIZE, VIEWS, OFF, REPEATS = 50_000, 256, 8, 0.02, 5
CAMERA = (35.0, 25.0)  # of the timed image: azimuth and elevation, degrees
OUTPUTS = ("visibility", "depth", "normals")
_BUILDERS = {"chair": chairs.build, "plane": planes.build, "car": cars.build}

Answer = tuple[np.ndarray, np.ndarray]  # depth, infinite on a miss, and normals


@dataclass(frozen=True)
class Way:
    """Something that answers rays of the mesh's frame. image: renders one, for the clock."""

    name: str
    ask: Callable[..., Answer]
    image: Callable[[], Any]
    size: int
    seconds: float


def real(names: Sequence[str]) -> dict[str, mesh_io.Mesh]:
    """Those from outside that are there."""
    there = [measuring.REAL_MESHES / name for name in names if (measuring.REAL_MESHES / name).is_file()]
    return {file.name: mesh_io.load_surface(file) for file in there}


def made() -> dict[str, mesh_io.Mesh]:
    """Those made here."""
    found = {}
    for kind, make in _BUILDERS.items():
        shape = assemble.shape(make(np.random.default_rng(7)), np.random.default_rng(7))
        found[f"made {kind}"] = mesh_io.Mesh(shape.vertices, shape.triangles)
    ring = trimesh.creation.torus(0.7, 0.3, major_sections=120, minor_sections=80)
    bars = [(axis, place) for axis in range(3) for place in itertools.product((-0.9, 0.0, 0.9), repeat=2)]
    cage = [_box(np.where(np.arange(3) == axis, 1.8, 0.03), np.insert(place, axis, 0)) for axis, place in bars]
    blades = [_box((1.6, 0.01, 0.4), (0, 0, 0), turn) for turn in np.linspace(0, np.pi, 5, endpoint=False)]
    others = {"ring": ring, "cage": trimesh.util.concatenate(cage), "blades": trimesh.util.concatenate(blades)}
    return found | {f"made {name}": mesh_io.Mesh(np.array(m.vertices), np.array(m.faces)) for name, m in others.items()}


def _box(sides: npt.ArrayLike, centre: npt.ArrayLike, turn: float = 0.0) -> trimesh.Trimesh:
    """Turned about z by an angle."""
    placed = trimesh.transformations.rotation_matrix(turn, (0, 0, 1))
    placed[:3, 3] = centre
    return trimesh.creation.box(sides, placed)


def network(given: scans.Scan | mesh_io.Mesh, steps: int, **settings: Any) -> shape_field.ShapeField:
    """As `ddf fit --steps` makes it, on one thread."""
    config = fit_settings.FitConfig(steps=steps, minutes=None, **settings)
    with tempfile.TemporaryDirectory() as folder:
        fitting.fit(given, config, Path(folder), threads=1)
        return shape_field.load(Path(folder))


def sine(mesh: mesh_io.Mesh, steps: int, size: int | None = None) -> Way:
    """A network after so many steps of one core; size: about its bytes, else as `ddf fit` has it."""
    started, usual = time.process_time(), fit_settings.FitConfig().field
    width = round((size / 4 / (len(usual.hidden) - 1)) ** 0.5) if size else usual.hidden[0]
    layout = dataclasses.replace(usual, hidden=(width,) * len(usual.hidden))
    field = network(mesh, steps, held_out=50, field=layout)
    return _way(f"sine, {steps} steps", field, 4 * field.parameters, time.process_time() - started)


def patches(mesh: mesh_io.Mesh, tolerance: float) -> tuple[Way, patch_field.PatchField]:
    """Patches of a tolerance, and their field."""
    started = time.process_time()
    arrays, record = patch_field.fitted(*fit_folder.in_cube(mesh), octree.PatchConfig.within(tolerance))
    took = time.process_time() - started
    size = sum(values.nbytes for values in arrays.values())
    field = patch_field.of(arrays, record)
    return _way(f"patches, {tolerance:g}", field, size, took), field


def _way(name: str, field: framed_field.FramedField, size: int, took: float) -> Way:
    def ask(points: rays.OrientedPoints, outputs: Sequence[str] = OUTPUTS) -> Answer:
        found, _ = framed_field.query(field, points, outputs)
        return found["depth"], found.get("normals", np.zeros(0))

    camera = (*CAMERA, framed_field.framing_radius(field, *CAMERA))
    return Way(name, ask, lambda: framed_field.render(field, camera, SIZE, ("visibility", "depth")), size, took)


def picture(field: framed_field.FramedField, azimuth: float, elevation: float) -> rays.OrientedPoints:
    """Rays of an image of the field, in the mesh's frame."""
    return beside.camera(field, (azimuth, elevation, framed_field.framing_radius(field, azimuth, elevation)), SIZE)


def cast(mesh: mesh_io.Mesh, points: rays.OrientedPoints) -> Way:
    """The mesh by Open3D, in float32. points: rays of the image."""
    scene = raycast.Scene(mesh)
    image, started = ray_casting.local_rays(scene, points), time.process_time()
    own = ray_casting.Open3D(scene)
    own(image[:1])
    took = time.process_time() - started

    def ask(asked: rays.OrientedPoints) -> Answer:
        depth, normals = own(ray_casting.local_rays(scene, asked))
        facing = np.where((normals * asked.directions).sum(axis=1, keepdims=True) > 0, -normals, normals)
        return depth.astype(np.float64) * scene.scale, facing

    return Way("mesh", ask, lambda: own(image), 12 * (len(mesh.vertices) + len(mesh.faces)), took)


def inner(mesh: mesh_io.Mesh, random: np.random.Generator) -> rays.OrientedPoints:
    """Uniform in the box, any way."""
    return rays.OrientedPoints(random.uniform(*mesh.box(), (RAYS, 3)), _ways(random))


def on_surface(scene: raycast.Scene, random: np.random.Generator) -> rays.OrientedPoints:
    """Uniform on the surface, any way; just off it on the side that they look to, so that the mesh knows."""
    chosen = random.choice(len(scene.areas), RAYS, p=scene.areas / scene.areas.sum())
    points = np.einsum("ni,nij->nj", random.dirichlet(np.ones(3), RAYS), scene.mesh.triangles[chosen])
    ways, normals = _ways(random), scene.normals[chosen]
    lift = raycast.SURFACE_OFFSET * scene.scale * np.sign((ways * normals).sum(axis=1))
    return rays.OrientedPoints(points + lift[:, None] * normals, ways)


def _ways(random: np.random.Generator) -> np.ndarray:
    ways = random.standard_normal((RAYS, 3))
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def errors(way: Way, scene: raycast.Scene, field: framed_field.FramedField) -> dict[str, float]:
    """Against the mesh."""
    random, found = np.random.default_rng(5), {}
    for name, points in {"inner": inner(scene.mesh, random), "surface": on_surface(scene, random)}.items():
        truth, depth = scene.first_hits(points.positions, points.directions)[0], way.ask(points)[0]
        found[f"wrong_{name}"] = 100 * float(inspection.wrong(depth, truth, OFF * scene.scale).mean())
    parts = []
    for view in range(VIEWS):
        points = picture(field, 360 * view / VIEWS + 20, (25.0, -15.0)[view % 2])
        truth, (depth, normals) = raycast.cast(scene, points), way.ask(points)
        seen = np.isfinite(depth)
        both = seen & truth.visible
        cosine = (normals[both] * truth.normals[both]).sum(axis=1)
        there, size = truth.visible, 2 * scene.scale
        hits = points.positions[there] + truth.depth[there, None] * points.directions[there]
        thin = inspection.thin(lambda *asked: scene.first_hits(*asked)[0], hits, truth.normals[there], size)
        right = ~inspection.wrong(depth[there], truth.depth[there], inspection.OFF * size)[thin]
        off = np.abs(depth[both] - truth.depth[both])
        parts.append((off, cosine, right, both.sum(), (seen | there).sum()))
    depths, cosines, right, both, either = zip(*parts, strict=True)
    depth = np.concatenate(depths) / scene.scale
    angle = np.degrees(np.arccos(np.clip(np.concatenate(cosines), -1, 1)))
    return {
        **found,
        "depth_median": float(np.median(depth)),
        "depth_mean": float(depth.mean()),
        "silhouettes": float(np.sum(both) / np.sum(either)),
        **({"thin": float(thin.mean())} if len(thin := np.concatenate(right)) else {}),
        "normals_deg": float(np.median(angle)),
    }


def compile_patches() -> None:
    """So that no time has it."""
    patches(ray_casting.sphere(100), 1e-2)


def rows_of(name: str, mesh: mesh_io.Mesh, frame: framed_field.FramedField, ways: Sequence[Way]) -> measuring.Rows:
    """All ways for one mesh, their images timed in turn. frame: a field, for its cameras."""
    scene = raycast.Scene(mesh)
    times = measuring.interleaved({way.name: way.image for way in ways}, REPEATS, clock=time.process_time)
    for way in ways:
        size = {"shape": name, "triangles": len(mesh.faces)}
        row = measuring.row(way.name, size, times[way.name], errors(way, scene, frame))
        yield {**row, "bytes": way.size, "made_in_s": way.seconds}


LINES = ("patches, 0.0003", "sine, 1500 steps")  # of the page


def main(*, steps: int = STEPS) -> measuring.Rows:
    """Every mesh and a growing sphere by every way.

    Args:
      steps: of the network.
    """
    compile_patches()
    spheres = {f"sphere {count:,}": ray_casting.sphere(count) for count in GROWING}
    for name, mesh in (real(REAL) | made() | spheres).items():
        tolerances = TOLERANCES[:1] if name in spheres else TOLERANCES
        fields = [patches(mesh, tolerance) for tolerance in tolerances]
        networks = [] if name in spheres else [sine(mesh, steps)]
        frame = fields[0][1]
        ways = [*(way for way, _ in fields), *networks, cast(mesh, picture(frame, *CAMERA))]
        yield from rows_of(name, mesh, frame, ways)

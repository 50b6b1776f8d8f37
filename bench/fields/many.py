"""Many objects of few fields in one scene file, beside a tree of all their triangles: bytes, speed and error.

Fifty procedural chairs, planes and cars, fitted to patches, stand in a square, scaled and turned at random; a line's
name tells how many objects. `field` is the scene file as `ddf.read_scene` reads it. `tree`, the float64 one that
`ddf fit` casts by, and `embree`, Open3D's in float32, are of one mesh of all objects: neither has instances. Times are
CPU time of a picture of 256 x 256 pixels from above, `inner_ms` of as many rays from anywhere among the objects. Every
line is a process of its own on one core: `mib` is what it holds after its answers more than before the scene, `read_s`
CPU seconds until the first answer. Errors are against `tree`: `depth_median` of an object's longest side of about 2,
`wrong` in percent of rays, as in `fits`.
"""

import json
import tempfile
import time
from collections.abc import Callable
from concurrent import futures
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from bench.data import ray_casting
from bench.fields import fits
from bench.lib import measuring
from ddf.api import field as api_field
from ddf.api import scene
from ddf.core import storage
from ddf.data.synthetic import assemble, cars, chairs, planes
from ddf.fields import scene_field
from ddf.fit import fit_folder, inspection
from ddf.geometry import mesh_io, raycast, rays

FIELDS, OBJECTS, SIDE, SIZE = 50, (10, 100, 1000), 2.0, 256  # side of the square of an object
WAYS = ("tree", "embree", "field")
_PAGE_MIB = 4096 / 2**20


def placements(count: int) -> list[dict[str, object]]:
    """So many objects of a scene file, each field as often."""
    random = np.random.default_rng(count)
    place, size = SIDE * np.sqrt(count) * (random.random((count, 2)) - 0.5), random.uniform(0.6, 1.0, count)
    return [
        {
            "field": f"field_{i % FIELDS}",
            "scale": round(float(scale), 4),
            "rotation_deg": [0.0, round(float(turn), 3), 0.0],
            "translation": [round(float(x), 4), 0.0, round(float(z), 4)],
        }
        for i, ((x, z), scale, turn) in enumerate(zip(place, size, random.uniform(0, 360, count), strict=True))
    ]


def all_triangles(folder: Path, count: int) -> mesh_io.Mesh:
    """The mesh of a scene file's objects."""
    objects = scene.read_content(folder / f"{count}.yaml").objects
    parts = [(mesh_io.load(folder / f"{each.field}.ply"), each.similarity()) for each in objects]
    starts = np.cumsum([0, *(len(part.vertices) for part, _ in parts[:-1])])
    vertices = np.concatenate([to.apply(part.vertices) for part, to in parts])
    faces = [part.faces + start for (part, _), start in zip(parts, starts, strict=True)]
    return mesh_io.Mesh(vertices, np.concatenate(faces))


def depths(way: str, folder: Path, count: int) -> Callable[[rays.OrientedPoints], np.ndarray]:
    """A scene by one of the ways: depths of rays, `inf` of a miss."""
    if way == "field":
        whole = scene.read_scene(folder / f"{count}.yaml")
        return lambda asked: whole.query(asked.positions, asked.directions, outputs=("depth",))["depth"]
    cast = raycast.Scene(all_triangles(folder, count))
    if way == "tree":
        return lambda asked: cast.first_hits(asked.positions, asked.directions)[0]
    own = ray_casting.Open3D(cast)
    return lambda asked: own(ray_casting.local_rays(cast, asked))[0].astype(np.float64) * cast.scale


def questions(count: int) -> dict[str, rays.OrientedPoints]:
    """The picture's rays, and the inner ones."""
    random, half = np.random.default_rng(0), SIDE * np.sqrt(count) / 2
    seen = scene_field.LookAt(half * np.array([1.0, 1.2, 2.0]), np.zeros(3)).rays(SIZE)
    starts, ways = random.uniform(-1, 1, (2, SIZE**2, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return {"picture": rays.OrientedPoints(*seen), "inner": rays.OrientedPoints(starts * [half, 0.5, half], ways)}


def resident() -> float:
    """MiB that this process holds."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * _PAGE_MIB


def answered(way: str, folder: Path, count: int) -> dict[str, Any]:
    """What a process of its own finds: depths and CPU seconds by question, and what reading took."""
    fits.compile_patches()
    before, started = resident(), time.process_time()
    ask, asked, found = depths(way, folder, count), questions(count), dict[str, Any]()
    ask(rays.OrientedPoints(asked["picture"].positions[:9], asked["picture"].directions[:9]))
    found["read_s"] = time.process_time() - started
    for name, each in asked.items():
        started = time.process_time()
        found[name] = ask(each)
        found[f"{name}_s"] = time.process_time() - started
    return found | {"mib": resident() - before}


def make(folder: Path) -> None:
    """Fields, meshes and scene files."""
    for i in range(FIELDS):
        build = (chairs.build, planes.build, cars.build)[i % 3]
        shape = assemble.shape(build(np.random.default_rng(i)), np.random.default_rng(i))
        mesh, _ = fit_folder.in_cube(mesh_io.Mesh(shape.vertices, shape.triangles))
        mesh.save(folder / f"field_{i}.ply")
        api_field.fit(mesh, out=folder / f"field_{i}")
    for count in OBJECTS:
        text = json.dumps({"objects": placements(count)}, separators=(",", ":"))  # YAML too
        storage.write_text(folder / f"{count}.yaml", text)


def main() -> measuring.Rows:
    """Ten, a hundred, a thousand objects, by every way."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        make(folder)
        for count in OBJECTS:
            found, triangles = dict[str, Any](), len(all_triangles(folder, count).faces)
            for way in WAYS:
                with futures.ProcessPoolExecutor(1, get_context("spawn")) as pool:
                    found[way] = own = pool.submit(answered, way, folder, count).result()
                error = {}
                for question in ("picture", "inner"):
                    depth, truth = own[question], found["tree"][question]
                    both = np.isfinite(depth) & np.isfinite(truth)
                    error[f"{question}_depth_median"] = float(np.median(np.abs(depth[both] - truth[both])))
                    error[f"{question}_wrong"] = 100 * float(inspection.wrong(depth, truth, fits.OFF).mean())
                size = {"fields": FIELDS, "triangles": triangles, "inner_ms": 1e3 * own["inner_s"]}
                size |= {key: own[key] for key in ("read_s", "mib")}
                yield measuring.row(f"{way}, {count}", size, [own["picture_s"]], error)

"""Shadows and ambient occlusion of public shapes by a field's rays: ddf-gs's task, against exact rays of the mesh.

Eight views from 2.5 around a shape whose longest side is 2. What a camera sees, and its normal, is the mesh's in every
line; only rays to the lamp, which is far, and 32 cosine rays to occlusion within .5 are asked of a way. `blind` is the
protocol of ddf-gs (Mishra 2026): rays begin .08 off the surface, and what they meet nearer than .10 is ignored; in
`near` they begin 2e-3 off it, and nothing is ignored. The lamp is a `point`, as theirs, or an `area`, .07 radians of
16 rays. Errors are PSNR in dB of grey pictures of [0, 1] on white, all views of a shape together, medians of shapes:
of object pixels, of whole pictures where a name ends so. `goal` is the percentage of shapes of 38 dB or more (shadows)
and 42 (occlusion) in `near`; a tenth of the shapes lies below `tenth`. Times are CPU time of a million rays of `near`.
Distances are of shapes without an open edge alone. `each`, a shape: dB of `near` (point, area, occlusion), microseconds
of a ray, kilobytes, seconds to make.
"""

import functools
import math
import time
from collections.abc import Callable, Iterator, Mapping

import numpy as np

from bench.fields import fits, frontier
from bench.lib import measuring
from ddf.core import checks
from ddf.data import mesh_topology
from ddf.data.public import manifest, packages
from ddf.data.public import shapes as public
from ddf.fields import scene_field
from ddf.fit import fit_folder
from ddf.geometry import mesh_io, raycast, rays

KEPT = True
VIEWS, ELEVATION, RADIUS = 8, 20.0, 2.5
AMBIENT, ALBEDO, LAMP_RADIUS, PARTS, HEMISPHERE, REACH = 0.25, 0.72, 0.07, 16, 32, 0.5
LAMP = np.array([-0.4, 0.8, 0.3]) / np.linalg.norm([-0.4, 0.8, 0.3])
PROTOCOLS = {"near": (2e-3, 0.0), "blind": (0.08, 0.10)}  # offset, and how near is ignored
GOALS = {"point": 38.0, "occlusion": 42.0, "area": 38.0}
TOLERANCES, SIDE = (1e-4, 3e-4), 128  # of patches; of the grid of distances
SHOWN = ("point_near", "area_near", "occlusion_near", "microseconds", "kilobytes", "made_in_s")
LINES = ("patches, 0.0003", "patches, 0.0001", "sine, 1000 steps", "distances, 128", "mesh")  # of the page

Depths = Callable[[rays.OrientedPoints], tuple[np.ndarray, object]]


def view(scene: raycast.Scene, index: int, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals that one of the ring of `VIEWS` sees, by the lens of `cameras`: 49 degrees, for their 50."""
    turn, tilt = 2 * np.pi * index / VIEWS, np.radians(ELEVATION)
    stand = np.array([np.cos(tilt) * np.sin(turn), np.sin(tilt), np.cos(tilt) * np.cos(turn)])
    starts, ways = scene_field.LookAt(RADIUS * stand, np.zeros(3)).rays(size)
    found = raycast.cast(scene, rays.OrientedPoints(starts, ways))
    hit = found.visible
    return rays.surface_points(starts[hit], ways[hit], found.depth[hit]), found.normals[hit]


def secondary(normals: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Unit directions (1 + PARTS + HEMISPHERE, n, 3): to the lamp, to places on it, over hemispheres by the cosine."""
    spread = random.standard_normal((PARTS + HEMISPHERE, len(normals), 3))
    spread /= np.linalg.norm(spread, axis=-1, keepdims=True)
    reach = LAMP_RADIUS * np.sqrt(random.random((PARTS, len(normals), 1)))
    across = np.cross(spread[:PARTS], LAMP)
    on_lamp = LAMP + reach * across / np.linalg.norm(across, axis=-1, keepdims=True)
    lamp = np.broadcast_to(LAMP, (1, *normals.shape))
    ways = np.concatenate([lamp, on_lamp, normals + spread[PARTS:]])
    return ways / np.linalg.norm(ways, axis=-1, keepdims=True)


def pictures(depth: np.ndarray, normals: np.ndarray, ignored: float) -> dict[str, np.ndarray]:
    """Grey values of the object's pixels by depths of the rays of `secondary`."""
    met = (depth > ignored) & np.isfinite(depth)
    lit = {"point": 1 - met[0], "area": 1 - met[1 : 1 + PARTS].mean(0)}
    facing, near = np.clip(normals @ LAMP, 0, None), met[1 + PARTS :] & (depth[1 + PARTS :] < REACH)
    shadows = {kind: ALBEDO * (AMBIENT + (1 - AMBIENT) * facing * share) for kind, share in lit.items()}
    return {**shadows, "occlusion": ALBEDO * (1 - near.mean(0))}


def decibels(square: float) -> float:
    """PSNR by the mean square; 100 of no error."""
    return min(100.0, -10 * math.log10(max(square, 1e-10)))


def scores(scene: raycast.Scene, asks: Mapping[str, Depths], size: int) -> dict[str, dict[str, float]]:
    """Of each way: dB by picture and protocol, and microseconds of a ray."""
    squares: dict[str, dict[str, float]] = {name: {} for name in asks}
    spent, count, pixels = dict.fromkeys(asks, 0.0), 0, 0
    for index in range(VIEWS):
        points, normals = view(scene, index, size)
        towards = secondary(normals, np.random.default_rng(index))
        pixels += len(points)
        for protocol, (offset, ignored) in PROTOCOLS.items():
            starts = np.broadcast_to(points + offset * normals, towards.shape).reshape(-1, 3)
            asked, timed = rays.OrientedPoints(starts, towards.reshape(-1, 3)), protocol == "near"
            count += timed * len(starts)
            exact = scene.first_hits(asked.positions, asked.directions)[0].reshape(towards.shape[:2])
            truth = pictures(exact, normals, ignored)
            for name, ask in asks.items():
                started = time.process_time()
                depth = ask(asked)[0].reshape(towards.shape[:2])
                spent[name] += timed * (time.process_time() - started)
                for kind, picture in pictures(depth, normals, ignored).items():
                    key, off = f"{kind}_{protocol}", float(np.square(picture - truth[kind]).sum())
                    squares[name][key] = squares[name].get(key, 0.0) + off
    found = {}
    for name, own in squares.items():
        whole = {f"{key}_whole": decibels(each / (VIEWS * size**2)) for key, each in own.items()}
        found[name] = {key: decibels(each / pixels) for key, each in own.items()} | whole
        found[name]["microseconds"] = 1e6 * spent[name] / count
    return found


def meshes(count: int) -> Iterator[tuple[str, mesh_io.Mesh]]:
    """So many, evenly over the shapes that `ddf shapes get` fetched, in a mixed order; InputError of too many."""
    rows = sorted(manifest.rows(), key=lambda row: (row.category, row.id))
    if not 0 < count <= len(rows):
        raise checks.InputError(f"count must be in [1, {len(rows)}]; got {count}")
    for index in np.random.default_rng(0).permutation(np.arange(count) * len(rows) // count):
        package = packages.PACKAGES[rows[index].package]
        with packages.reading(packages.require(package, manifest.wanted(package.name))) as kept:
            made = public.load(kept, rows[index])
        yield f"{rows[index].category}/{rows[index].id}", mesh_io.Mesh(made.vertices, made.faces)


def ways(mesh: mesh_io.Mesh, scene: raycast.Scene, steps: int) -> Iterator[tuple[fits.Way, Depths]]:
    """Those for a mesh in [-1, 1]³. steps: of a network, 0 for none, and for no coarser patches."""
    fields = [fits.patches(mesh, tolerance)[0] for tolerance in TOLERANCES[: 1 + (steps > 0)]]
    for way in fields + ([fits.sine(mesh, steps)] if steps else []):
        yield way, functools.partial(way.ask, outputs=("depth",))
    ray = rays.OrientedPoints(np.array([[0.0, 0, 5]]), np.array([[0.0, 0, -1]]))
    closed = mesh_topology.is_watertight(mesh_topology.clean(mesh))
    for way in [frontier.grid(scene, SIDE, ray)] * closed + [fits.cast(mesh, ray)]:
        yield way, way.ask


def summary(name: str, size: int, found: Mapping[str, Mapping[str, float]]) -> measuring.Row:
    """The line of a way. found: of each shape."""
    table = {key: np.array([own[key] for own in found.values()]) for key in next(iter(found.values()))}
    middle = {key: float(np.median(values)) for key, values in table.items()}
    error = {f"{kind}_near": middle[f"{kind}_near"] for kind in ("point", "occlusion")}
    error |= {f"{kind}_goal": 100 * float((table[f"{kind}_near"] >= least).mean()) for kind, least in GOALS.items()}
    error |= {key: middle[key] for key in table if key not in SHOWN[-3:]}
    error |= {f"{kind}_tenth": float(np.quantile(table[f"{kind}_near"], 0.1)) for kind in GOALS}
    about = {"shapes": len(found), "pixels": size, "kilobytes": round(middle["kilobytes"], 1)}
    row = measuring.row(name, about, list(table["microseconds"]), error)  # seconds of a million rays
    most = {f"{key}_most": float(table[key].max()) for key in SHOWN[-3:]}
    each = {shape: " ".join(f"{own[key]:.4g}" for key in SHOWN) for shape, own in found.items()}
    return {**row, "made_in_s": middle["made_in_s"], **most, "each": each}


def main(*, count: int = 60, size: int = 512, few: int = 4, steps: int = 1000) -> measuring.Rows:
    """Every shape by every way; lines grow from shape to shape; some hours.

    Args:
      count: of shapes.
      size: pixels a side of a view.
      few: so many shapes have coarser patches and a network too.
      steps: of the network.
    """
    fits.compile_patches()
    found: dict[str, dict[str, dict[str, float]]] = {}
    for index, (shape, raw) in enumerate(meshes(count)):
        mesh, _ = fit_folder.in_cube(raw)
        scene = raycast.Scene(mesh)
        made = list(ways(mesh, scene, steps if index < few else 0))
        own = scores(scene, {way.name: ask for way, ask in made}, size)
        for way, _ in made:
            rest = {"kilobytes": way.size / 1024, "made_in_s": way.seconds}
            found.setdefault(way.name, {})[shape] = own[way.name] | rest
            yield summary(way.name, size, found[way.name])

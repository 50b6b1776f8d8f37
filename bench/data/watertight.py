"""Making meshes watertight: alpha x decimator x triangles -> seconds, distances lost, and whether the result is closed.

Procedural shapes, and real ones where they lie beside the project. What is timed is `mesh_preparation.prepare` itself
where a row says `prepare`, with its loss measured as part of it; for the rows over alpha, triangles and decimators
each of the shapes `SWEPT` is wrapped and decimated once, and the result is measured outside the clock. Distances are
shares of the raw box's diagonal.
"""

import functools
import statistics
import time
from collections.abc import Callable
from typing import Any

import fast_simplification
import numpy as np
import pymeshlab
import torch

from bench.lib import measured_shapes, measuring
from ddf.core import checks
from ddf.data import mesh_preparation, mesh_topology
from ddf.data.mesh_config import MeshesConfig
from ddf.geometry import transforms
from ddf.geometry.mesh_io import Mesh

DEFAULT = MeshesConfig()
ALPHAS, FACES = (0.01, 0.02, 0.04), (2500, 10_000)
SEEDS = {"chair": 3, "plane": 1, "car": 2}
REAL = ("mug.stl", "car_kaykit_sedan.obj", "chair_aws_A.ply", "hard_winding_wallclock.stl", "spot_23k.obj")
THREADS, PROBES = 2, 10_000
SWEPT = ("procedural chair", "procedural plane", "procedural car", "mug", "car_kaykit_sedan")  # those that are there
REPEATS, MOST_SECONDS = 3, 1.5  # of one shape in one row: no more once they took so long
Result = tuple[list[float], dict[str, float]]  # of one shape: seconds of each repeat, and what was lost

Decimator = Callable[[Mesh, int], Mesh]


def quadric(mesh: Mesh, faces: int) -> Mesh:
    """MeshLab's quadric edge collapse that preserves the topology."""
    work = pymeshlab.MeshSet(verbose=False)
    work.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    work.meshing_decimation_quadric_edge_collapse(
        targetfacenum=faces, preservetopology=True, preservenormal=True, planarquadric=True
    )
    current = work.current_mesh()
    return Mesh(current.vertex_matrix(), current.face_matrix())


def fast(mesh: Mesh, faces: int) -> Mesh:
    """fast-simplification's edge collapse, which does not look at the topology."""
    corners = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    return Mesh(*fast_simplification.simplify(np.ascontiguousarray(mesh.vertices), corners, target_count=faces))


def shrunk(wrap: Mesh, faces: int, decimate: Decimator) -> Mesh:
    """To so many triangles, where there are more."""
    return decimate(wrap, faces) if len(wrap.faces) > faces else wrap


DECIMATORS: dict[str, Decimator] = {
    "pymeshlab quadric": quadric,
    "fast-simplification": fast,
    "ddf": mesh_preparation.decimate,
}


def shapes() -> dict[str, Mesh]:
    """Procedural ones always, real ones where they are."""
    made = {f"procedural {kind}": measured_shapes.procedural(kind, seed) for kind, seed in SEEDS.items()}
    return {**made, **measured_shapes.real(REAL)}


def timed(work: Callable[[], Any], repeats: int = REPEATS) -> tuple[Any, list[float]]:
    """A result, and the seconds of as many of the repeats as the time allows."""
    result, seconds = None, list[float]()
    while not seconds or (len(seconds) < repeats and sum(seconds) < MOST_SECONDS):
        started = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - started)
    return result, seconds


def wrap_of(raw: Mesh, alpha: float) -> tuple[Mesh, Mesh]:
    """The cleaned mesh in a frame of order 1, and its wrap."""
    unit = mesh_topology.clean(Mesh(transforms.field_from_mesh(raw.surface_vertices()).apply(raw.vertices), raw.faces))
    return unit, mesh_preparation.close(unit, alpha, DEFAULT.offset)


def row_of(what: str, size: dict[str, Any], results: list[Result]) -> dict[str, Any]:
    """A row over shapes: seconds of the median shape, once per repeat; medians and worst of the distances.

    Shapes differ by far more than repeats do: quartiles over shapes would say nothing of a second run.
    """
    repeats = min(len(seconds) for seconds, _ in results)
    middle = [statistics.median(seconds[i] for seconds, _ in results) for i in range(repeats)]
    losses = [loss for _, loss in results]
    error = {
        "hausdorff_median": statistics.median(loss["hausdorff_seen"] for loss in losses),
        "hausdorff_max": max(loss["hausdorff_seen"] for loss in losses),
        "mean_distance_median": statistics.median(loss["mean_distance_seen"] for loss in losses),
        "watertight_share": statistics.mean(loss["watertight"] for loss in losses),
    }
    return measuring.row(what, {**size, "shapes": len(results)}, middle, error)


def loss(unit: Mesh, small: Mesh) -> dict[str, float]:
    """Distances of `mesh_preparation.measure` and whether the result is closed."""
    figures = mesh_preparation.measure(unit, small, PROBES, np.random.default_rng(0))
    return {**figures, "watertight": float(mesh_topology.is_watertight(small))}


def sweep(raw: dict[str, Mesh]) -> list[dict[str, Any]]:
    """One row per alpha, number of triangles and decimator, over the shapes; wraps are made once per alpha."""
    rows = []
    for alpha in ALPHAS:
        wraps = [timed(lambda mesh=mesh, alpha=alpha: wrap_of(mesh, alpha), 1) for mesh in raw.values()]
        for faces in FACES:
            for name, decimate in DECIMATORS.items():
                results: list[Result] = []
                for (unit, wrap), wrapping in wraps:
                    try:
                        small, seconds = timed(functools.partial(shrunk, wrap, faces, decimate), 1)
                    except checks.InputError:  # ddf's own refuses what cannot stay closed
                        continue
                    both = [a + b for a, b in zip(wrapping, seconds, strict=True)]
                    results.append((both, loss(unit, small)))
                size = {"alpha": alpha, "faces": faces, "refused": len(wraps) - len(results)}
                rows.append(row_of(f"wrap, {name}", size, results))
    return rows


def default_quality(raw: dict[str, Mesh]) -> list[dict[str, Any]]:
    """The whole of `mesh_preparation.prepare` at its defaults: what the stage does with a shape that must be closed."""
    results: list[Result] = []
    for mesh in raw.values():
        prepared, seconds = timed(lambda mesh=mesh: mesh_preparation.prepare(mesh, DEFAULT, np.random.default_rng(0)))
        figures = {name: getattr(prepared, name) for name in ("hausdorff_seen", "mean_distance_seen")}
        results.append((seconds, {**figures, "watertight": float(prepared.watertight)}))
    size = {"alpha": DEFAULT.alpha, "faces": DEFAULT.faces}
    each = [
        measuring.row(f"prepare, {name}", size, seconds, figures)
        for name, (seconds, figures) in zip(raw, results, strict=True)
    ]
    return [row_of("prepare, default quality", size, results), *each]


def main() -> None:
    """The default quality first, then the sweep."""
    torch.set_num_threads(THREADS)
    raw = shapes()
    rows = default_quality(raw)
    print(
        f"default quality: median {rows[0]['median_s']:.2f} s, worst Hausdorff {rows[0]['error']['hausdorff_max']:.4f}"
    )
    measuring.write("watertight", THREADS, rows + sweep({name: mesh for name, mesh in raw.items() if name in SWEPT}))

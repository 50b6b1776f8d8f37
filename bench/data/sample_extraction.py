"""Samples of a shape, drawn, cast, packed and written, against what Open3D alone needs to cast the same rays.

Shapes of 10,000 triangles in the field frame, the numbers of samples of configs/cpu.yaml and of [DDF22]; the clouds of
the stage `samples` have rows of their own. "Open3D alone" holds the rays ready in memory: with the building of its
scene, which every shape needs once, and without. A file holds a shard of as many shapes as the config says, its seconds
are shared among them. The error is that of the stored form.
"""

import concurrent.futures
import contextlib
import functools
import multiprocessing
import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
import torch

from bench.lib import display, measured_shapes, measuring, results
from ddf.core import config, storage
from ddf.data import mesh_preparation, packing, sampling, true_clouds
from ddf.data.mesh_config import MeshesConfig
from ddf.data.samples import sample_types
from ddf.geometry import raycast
from ddf.geometry.mesh_io import Mesh

CONFIGS = ("configs/cpu.yaml", "configs/paper.yaml")
FACES, REPEATS, CLOUD_POINTS, THREADS = 10_000, 5, 8000, (1, 2)


def field_meshes() -> dict[str, Mesh]:
    """A chair as the stage `meshes` gives it, with its inner faces, and a sphere of as many triangles as it allows."""
    chair = mesh_preparation.prepare(
        measured_shapes.procedural("chair", 3), MeshesConfig(wrap="never"), np.random.default_rng(0)
    ).mesh
    return {"sphere": measured_shapes.sphere(FACES), "chair": chair}


def stored_rays(mesh: Mesh, arrays: dict[str, np.ndarray]) -> o3d.core.Tensor:
    """The rays of stored samples, in the frame of `raycast.Scene`."""
    tensors = {name: torch.from_numpy(values) for name, values in arrays.items()}
    decoded = [packing.decode(tensors, kind) for kind in sample_types.KINDS]
    positions = raycast.Scene(mesh).local(torch.cat([samples["positions"] for samples in decoded]).numpy())
    directions = torch.cat([samples["directions"] for samples in decoded]).numpy()
    return o3d.core.Tensor(np.concatenate([positions, directions], axis=1).astype(np.float32))


def built(mesh: Mesh) -> o3d.t.geometry.RaycastingScene:
    """Open3D's own scene of a mesh, as Open3D's user builds it; it is finished by its first cast."""
    scene = o3d.t.geometry.RaycastingScene()
    vertices = raycast.Scene(mesh).local(mesh.vertices).astype(np.float32)
    scene.add_triangles(o3d.core.Tensor(vertices), o3d.core.Tensor(mesh.faces.astype(np.uint32)))
    return scene


def extract_and_write(mesh: Mesh, drawn: sampling.SamplesConfig, path: Path) -> None:
    """What the stage does for the samples of a shard."""
    found = [sampling.extract(mesh, drawn, str(index)) for index in range(drawn.shard_size)]
    arrays = {name: np.stack([arrays[name] for arrays, _ in found]) for name in found[0][0]}
    storage.save_tensors(path, arrays, {"packing_errors": sampling.packing_errors([probes for _, probes in found])})


def occlusion_rays(scene: raycast.Scene, points: np.ndarray, face: np.ndarray) -> list[o3d.core.Tensor]:
    """The rays that decide which points of a cloud are seen from outside, portion by portion."""
    asked: list[o3d.core.Tensor] = []

    class Recorder(raycast.Scene):
        def blocked_local(self, positions: np.ndarray, directions: np.ndarray) -> np.ndarray:
            asked.append(o3d.core.Tensor(np.concatenate([positions, directions], axis=1).astype(np.float32)))
            return super().blocked_local(positions, directions)

    raycast.visible_from_outside(Recorder(scene.mesh), points, face)
    return asked


def measure(name: str, mesh: Mesh, path: Path, folder: Path) -> list[dict[str, Any]]:
    """Rows of one shape and one experiment's counts."""
    drawn = config.load(Path(path), "samples", sampling.SamplesConfig)
    arrays, probes = sampling.extract(mesh, drawn, "bench")
    errors = sampling.packing_errors([probes])
    tensor, scene = stored_rays(mesh, arrays), built(mesh)
    faces, corners = mesh.faces.astype(np.uint32), raycast.Scene(mesh).local(mesh.vertices).astype(np.float32)

    def alone() -> Any:
        fresh = o3d.t.geometry.RaycastingScene()
        fresh.add_triangles(o3d.core.Tensor(corners), o3d.core.Tensor(faces))
        return fresh.cast_rays(tensor)

    written = "samples, file written"
    ways: dict[str, Callable[[], Any]] = {
        "Open3D alone": functools.partial(scene.cast_rays, tensor),
        "Open3D alone, scene built": alone,
        "samples": functools.partial(sampling.extract, mesh, drawn, "bench"),
        written: functools.partial(extract_and_write, mesh, drawn, folder / "samples.safetensors"),
    }
    times = measuring.interleaved(ways, REPEATS)
    exact = dict.fromkeys(errors, 0.0)  # of Open3D alone, which casts what it is given
    times[written] = [seconds / drawn.shard_size for seconds in times[written]]
    size = {"shape": name, "triangles": len(mesh.faces), "rays": tensor.shape[0], "counts": path.stem}
    return [
        measuring.row(way, size, seconds, errors if way.startswith("samples") else exact)
        for way, seconds in times.items()
    ]


def measure_cloud(name: str, mesh: Mesh) -> list[dict[str, Any]]:
    """Rows of the ground-truth cloud: points, and which are hidden. The error: points beside the number wanted."""
    scene = raycast.Scene(mesh)
    points, face = true_clouds.poisson_disk(mesh, CLOUD_POINTS, np.random.default_rng(0))
    asked, own = occlusion_rays(scene, points, face), built(mesh)
    ways: dict[str, Callable[[], Any]] = {
        "cloud, Open3D alone": lambda: [own.test_occlusions(part) for part in asked],
        "cloud, points": lambda: true_clouds.poisson_disk(mesh, CLOUD_POINTS, np.random.default_rng(0)),
        "cloud": lambda: true_clouds.draw(mesh, CLOUD_POINTS, np.random.default_rng(0)),
    }
    rays = sum(part.shape[0] for part in asked)
    size = {"shape": name, "triangles": len(mesh.faces), "rays": rays, "points": len(points)}
    error = {"count_share": abs(len(points) / CLOUD_POINTS - 1)}
    return [measuring.row(way, size, seconds, error) for way, seconds in measuring.interleaved(ways, REPEATS).items()]


def measure_all(threads: int) -> list[dict[str, Any]]:
    """All rows; in a process of its own that was started on so many cores (`on_cores`)."""
    torch.set_num_threads(threads)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, mesh in field_meshes().items():
            for path in CONFIGS:
                rows += measure(name, mesh, Path(path), Path(folder))
            rows += measure_cloud(name, mesh)
    return [{**row, "size": {**row["size"], "threads": threads}} for row in rows]


@contextlib.contextmanager
def on_cores(count: int) -> Iterator[None]:
    """Keep this thread, and the processes that it starts meanwhile, to so many cores.

    A process that limits itself after its imports reaches neither the threads that these have started nor the number
    of cores that they have counted: Open3D could cast on all cores beside numpy on one.
    """
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(before)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def _samples_on_one_core(row: results.Row) -> bool:
    """Rows of the samples of a shape, not of its cloud."""
    return "counts" in row.size and row.size.get("threads") == 1


def extraction_note(benchmark: results.Benchmark) -> str | None:
    """What a shape's samples take, file written, over Open3D's casting alone."""
    found: dict[int, list[str]] = {}
    for row in benchmark.rows:
        if row.what == "samples, file written":
            same = [
                each for each in benchmark.rows if each.size == row.size and each.what == "Open3D alone, scene built"
            ]
            words = f"{row.size['shape']} ({row.size['counts']}) {display.times(row, same[0])}" if same else ""
            found.setdefault(row.size["threads"], []).append(words)
    parts = [f"on {cores} core{'s' if cores > 1 else ''} {', '.join(words)}" for cores, words in found.items()]
    if not parts:
        return None
    return (
        "Samples of a shape, file written, as a multiple of Open3D's time for the same rays, its scene built: "
        f"{'; '.join(parts)}. The goal is at most 2."
    )


SECTION = display.Section(
    views=(
        display.View("position_shift", "shift of a stored position", ("shape", "counts"), keep=_samples_on_one_core),
    ),
    note=extraction_note,
)


def main() -> None:
    """Measure both shapes with the counts of both experiments, and their clouds, on one core and on two."""
    rows = []
    for threads in THREADS:
        context = multiprocessing.get_context("spawn")
        with on_cores(threads), concurrent.futures.ProcessPoolExecutor(1, context) as process:
            rows += process.submit(measure_all, threads).result()
    measuring.write("sample_extraction", max(THREADS), rows)

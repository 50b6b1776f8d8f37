"""Depth images: a DDF against casting its mesh and against sphere tracing a signed-distance network of the same size.

Both networks have the hidden layers of configs/fit.yaml and are trained here, each for `TRAIN_SECONDS`, samples
included, on one closed procedural shape. Rows hold ms per image, over two cameras, with errors against float64 casting
of the mesh: depth (field units; half the box's longest side is 1) over the pixels that both see, the share of all
pixels whose visibility is wrong, the silhouettes' intersection over union, the median angle of the normals. Timed is
the way from camera rays to depth and visibility. "Refined" asks for fewer pixels (`sparse_depth`), of the DDF and of
the tracings. The growth with resolution and with the mesh's triangles is drawn in reports/bench/rendering.png.
"""

import dataclasses
import functools
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
import trimesh
from torch import Tensor

from bench.lib import display, growth_curves, measuring, results
from bench.rivals import sphere_tracing
from ddf.core import config, seeding
from ddf.data import mesh_config, mesh_preparation
from ddf.fields import derivatives, field_values, framed_field, siren
from ddf.fit import fit_settings, fitting, shape_field
from ddf.geometry import mesh_io, raycast, rays, sparse_depth
from ddf_lab.evaluation.shape import source_mesh
from ddf_lab.report.shape import shape_views

CONFIG, THREADS, REPEATS, TRAIN_SECONDS = Path("configs/fit.yaml"), 2, 5, 60.0
TRAINED_TOLERANCE = 0.5  # of errors from run to run: who trains for a time takes as many steps as the machine allows
CHUNK = 4096  # rays: their activations stay in the cache; the same for both networks
SIZES, COMPARED, LARGEST = (64, 128, 256, 512), 256, 512
FACES, SUBDIVISIONS = 4_000, 3  # of the mesh at most, and how often they are cut in four to see casting grow
BUDGETS = tuple(
    sphere_tracing.Tracing(steps, threshold, within, relaxation, CHUNK)
    for steps, threshold, within, relaxation in (
        (4, 3e-2, 6e-2, 1.0),
        (6, 2e-2, 4e-2, 1.0),
        (8, 1e-2, 2e-2, 1.0),
        (12, 1e-2, 1e-2, 1.0),
        (16, 5e-3, 5e-3, 1.0),
        (16, 5e-3, 5e-3, 1.3),
        (32, 2e-3, 5e-3, 1.0),
        (64, 1e-3, 5e-3, 1.0),
        (64, 1e-3, 5e-3, 1.3),
    )
)
GROWN = BUDGETS[4]  # is drawn at other resolutions: the same in every run, for which one is as good as the DDF differs
DISTANCE_OMEGA, DISTANCE_RATE = 10.0, 2e-3  # omega_first and learning rate of the signed-distance network
REFINED = sparse_depth.Refinement(tolerance=0.005, stride=8)  # field units: under half of what either network is off by
Image = Callable[[], tuple[Tensor, int]]  # depth, `inf` where nothing is seen, and the number of queries
RayImage = Callable[[Tensor, Tensor], tuple[Tensor, int]]  # the same of some rays: starts, directions


@dataclasses.dataclass(frozen=True)
class Views:
    """The pixels of both cameras as rays of the field frame, and what the mesh shows there."""

    starts: Tensor
    directions: Tensor
    truth: rays.RayHits


def closed_shape(seed: int) -> mesh_io.Mesh:
    """A procedural chair without openings, field frame."""
    raw, _ = source_mesh.read(None, seed)
    found = mesh_preparation.prepare(
        raw, mesh_config.MeshesConfig(faces=FACES, wrap="always"), seeding.generator(seed, "bench")
    )
    return found.mesh


def views(shape: shape_field.ShapeField, mesh: mesh_io.Mesh, size: int) -> Views:
    """Both cameras of the reference page that stand outside."""
    both = [framed_field.camera_rays(shape, camera, size) for _, camera in shape_views.OUTSIDE]
    starts, directions = (torch.from_numpy(np.concatenate(part)) for part in zip(*both, strict=True))
    truth = raycast.cast(mesh, rays.OrientedPoints(starts, directions))
    return Views(starts.float(), directions.float(), truth)


@torch.inference_mode()
def ddf_depth(
    shape: shape_field.ShapeField, starts: Tensor, directions: Tensor, box: bool = True
) -> tuple[Tensor, int]:
    """One query per ray that meets the box; without `box` one for every ray.

    What the field says of a ray that misses the box, where it was never trained, differs from fit to fit: such a ray
    sees nothing.
    """
    lower, upper = (torch.from_numpy(corner).float() for corner in (shape.lower, shape.upper))
    entry, distance, meets = rays.enter_box(starts, directions, lower, upper)
    asked = torch.nonzero(meets | (not box)).squeeze(-1)
    depth = torch.full_like(distance, torch.inf)
    for chosen in asked.split(CHUNK):
        found = field_values.evaluate(shape.field, entry[chosen], directions[chosen], ("visibility", "depth"))
        seen = meets[chosen] & (found["visibility"] >= framed_field.SEEN)
        depth[chosen] = torch.where(seen, found["depth"] + distance[chosen], torch.inf)
    return depth, len(asked)


@torch.inference_mode()
def traced_depth(
    network: siren.SineNetwork,
    shape: shape_field.ShapeField,
    starts: Tensor,
    directions: Tensor,
    how: sphere_tracing.Tracing,
) -> tuple[Tensor, int]:
    """Sphere tracing in the same box."""
    lower, upper = (torch.from_numpy(corner).float() for corner in (shape.lower, shape.upper))
    return sphere_tracing.trace(lambda p: network(p).squeeze(-1), starts, directions, lower, upper, how)


def cast_depth(scene: raycast.Scene, local: np.ndarray) -> tuple[Tensor, int]:
    """Open3D in float32, rays ready in the scene's own frame; nothing but the casting is timed."""
    depth, _ = scene.cast_local(local)
    return torch.from_numpy(depth) * scene.scale, len(depth)


def refined(image: RayImage, seen: Views, size: int) -> tuple[Tensor, int]:
    """Both images from fewer rays: `image` gives depth and number of queries of some."""
    whole, queries = [], 0
    for first in range(0, len(seen.starts), size**2):

        def ask(pixels: np.ndarray, first: int = first) -> np.ndarray:
            nonlocal queries
            rows = torch.from_numpy(pixels) + first
            depth, count = image(seen.starts[rows], seen.directions[rows])
            queries += count
            return depth.double().numpy()

        whole.append(torch.from_numpy(sparse_depth.depth_image(ask, size, REFINED)[0]).flatten().float())
    return torch.cat(whole), queries


def errors(depth: Tensor, normals: Tensor | None, truth: rays.RayHits) -> dict[str, float]:
    """Against the truth; normals only where both see a surface."""
    seen = torch.isfinite(depth)
    both = seen & truth.visible
    off = (depth[both].double() - truth.depth[both]).abs()
    found = {
        "depth_median": float(off.median()),
        "depth_mean": float(off.mean()),
        "wrong_visibility": float((seen != truth.visible).double().mean()),
        "silhouette_iou": int(both.sum()) / int((seen | truth.visible).sum()),
    }
    if normals is not None:
        cosine = (normals[both].double() * truth.normals[both]).sum(-1).clamp(-1, 1)
        found["normal_angle_deg_median"] = float(torch.rad2deg(torch.acos(cosine)).median())
    return found


def ddf_normals(shape: shape_field.ShapeField, starts: Tensor, directions: Tensor) -> Tensor:
    """Of every ray that meets the box, 0 elsewhere."""
    lower, upper = (torch.from_numpy(corner).float() for corner in (shape.lower, shape.upper))
    entry, _, meets = rays.enter_box(starts, directions, lower, upper)
    normals = torch.zeros_like(starts)
    normals[meets] = field_values.evaluate(shape.field, entry[meets], directions[meets], ("normals",))["normals"]
    return normals


def distance_normals(network: siren.SineNetwork, starts: Tensor, directions: Tensor, depth: Tensor) -> Tensor:
    """∇f/‖∇f‖ at the hits, facing back; 0 elsewhere."""
    hit = torch.isfinite(depth)
    found = derivatives.trace(network, rays.surface_points(starts[hit], directions[hit], depth[hit]))
    gradient = derivatives.adjoint(network, found.slopes, torch.ones_like(found.outputs))
    normals = torch.zeros_like(starts)
    normals[hit] = derivatives.normals(gradient, directions[hit])
    return normals


def measured(
    candidates: Mapping[str, Image],
    size: int,
    seen: Views,
    normals: Mapping[str, Callable[[Tensor], Tensor]],
    extra: Mapping[str, Any],
) -> list[dict[str, Any]]:
    """A row per candidate: seconds of one image of `size` pixels a side."""
    images = len(seen.starts) / size**2
    times = measuring.interleaved(candidates, REPEATS)
    rows = []
    for name, seconds in times.items():
        tolerance = 0.0 if name == CASTING else TRAINED_TOLERANCE
        depth, queries = candidates[name]()
        error = errors(depth, normals[name](depth) if name in normals else None, seen.truth)
        row = measuring.row(name, {"pixels_a_side": size, **extra}, [t / images for t in seconds], error, tolerance)
        per_pixel = 0.0 if name == CASTING else queries / len(seen.starts)
        rows.append({**row, "ms_per_image": 1e3 * row["median_s"], "queries_per_pixel": per_pixel})
    return rows


DDF, CASTING = "DDF", "mesh casting"
FEWER = ", refined"  # behind the name of what is asked for fewer pixels


def tracing_name(how: sphere_tracing.Tracing) -> str:
    """Of a budget, in tables and pictures."""
    relaxed = f", relaxed {how.relaxation:g}" if how.relaxation > 1 else ""
    return f"sphere tracing, {how.max_steps} steps, f < {how.threshold:g}{relaxed}"


def growing_mesh(mesh: mesh_io.Mesh, seen: Views, size: int) -> list[dict[str, Any]]:
    """Casting of the same surface in ever more triangles."""
    rows, vertices, faces = [], mesh.vertices, mesh.faces
    for _ in range(SUBDIVISIONS + 1):
        scene = raycast.Scene(mesh_io.Mesh(vertices, faces))
        local = _local(scene, seen)
        image = {CASTING: lambda scene=scene, local=local: cast_depth(scene, local)}
        rows += measured(image, size, seen, {}, {"triangles": len(faces)})
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)[:2]
    return rows


def _local(scene: raycast.Scene, seen: Views) -> np.ndarray:
    return np.concatenate((scene.local(seen.starts.numpy()), seen.directions.numpy()), axis=1).astype(np.float32)


@dataclasses.dataclass(frozen=True)
class Fitted:
    """Both networks after equal time, the mesh in their frame, and what their trainings were."""

    shape: shape_field.ShapeField
    network: siren.SineNetwork
    mesh: mesh_io.Mesh
    sizes: dict[str, Any]
    steps: dict[str, int]


def fitted(mesh: mesh_io.Mesh) -> Fitted:
    """Train both."""
    section = config.load(CONFIG, "fit", fit_settings.FitConfig)
    loop = dataclasses.replace(section.loop, threads=THREADS)
    section = dataclasses.replace(section, steps=None, minutes=TRAIN_SECONDS / 60, loop=loop)
    with tempfile.TemporaryDirectory() as folder:
        result = fitting.fit(mesh, section, Path(folder))
        shape = shape_field.load(Path(folder))
    shape.field.cpu()
    layout = siren.SineLayout(section.field.hidden, DISTANCE_OMEGA)
    rival = sphere_tracing.DistanceConfig(layout, dataclasses.replace(loop, learning_rate=DISTANCE_RATE))
    placed = mesh_io.Mesh(shape.field_from_mesh.apply(mesh.vertices), mesh.faces)
    network, steps = sphere_tracing.fit_distance(placed, rival, TRAIN_SECONDS)
    sizes = {"hidden": list(section.field.hidden), "train_seconds": TRAIN_SECONDS}
    return Fitted(shape, network, placed, sizes, {"ddf_steps": result["steps"], "signed_distance_steps": steps})


def measure() -> list[dict[str, Any]]:
    """All rows, and the picture of growth."""
    both = fitted(closed_shape(0))
    shape, network, mesh = both.shape, both.network, both.mesh
    torch.set_num_threads(THREADS)
    torch.use_deterministic_algorithms(False)  # as in `ddf render`; training switches it on
    scene = raycast.Scene(mesh)

    def images(seen: Views, budgets: Sequence[sphere_tracing.Tracing]) -> dict[str, Image]:
        local = _local(scene, seen)
        found: dict[str, Image] = {DDF: lambda: ddf_depth(shape, seen.starts, seen.directions)}
        for how in budgets:
            found[tracing_name(how)] = lambda how=how: traced_depth(network, shape, seen.starts, seen.directions, how)
        return found | {CASTING: lambda: cast_depth(scene, local)}

    def fewer(seen: Views, size: int, budgets: Sequence[sphere_tracing.Tracing]) -> dict[str, Image]:
        """The DDF and tracings from fewer pixels."""
        asked: dict[str, RayImage] = {DDF: functools.partial(ddf_depth, shape)}
        asked |= {tracing_name(how): functools.partial(traced_depth, network, shape, how=how) for how in budgets}
        return {name + FEWER: functools.partial(refined, image, seen, size) for name, image in asked.items()}

    seen = views(shape, mesh, COMPARED)
    candidates = images(seen, BUDGETS) | fewer(seen, COMPARED, BUDGETS)
    with torch.no_grad():
        normals = {DDF: lambda _: ddf_normals(shape, seen.starts, seen.directions)} | {
            tracing_name(how): lambda depth: distance_normals(network, seen.starts, seen.directions, depth)
            for how in BUDGETS
        }
        facts = {**both.sizes, "triangles": len(mesh.faces)}
        rows = measured(candidates, COMPARED, seen, normals, facts)
    (own,) = [row for row in rows if row["what"] == DDF]
    for row in rows:
        row["times_ddf"] = row["median_s"] / own["median_s"]
    drawn = (DDF, DDF + FEWER, CASTING, tracing_name(GROWN), tracing_name(GROWN) + FEWER)
    by_size = [row for row in rows if row["what"] in drawn]
    for size in SIZES:
        if size != COMPARED:
            now = views(shape, mesh, size)
            new = measured(images(now, [GROWN]) | fewer(now, size, [GROWN]), size, now, {}, facts)
            rows, by_size = rows + new, by_size + [row for row in new if row["what"] in drawn]
    largest = views(shape, mesh, LARGEST)
    everywhere = {"DDF, every pixel evaluated": lambda: ddf_depth(shape, largest.starts, largest.directions, box=False)}
    rows += measured(everywhere, LARGEST, largest, {}, facts)
    by_faces = growing_mesh(mesh, seen, COMPARED)
    draw(by_size, by_faces)
    return [{**row, **both.steps} for row in rows] + by_faces


def draw(by_size: Sequence[dict[str, Any]], by_faces: Sequence[dict[str, Any]]) -> None:
    """ms per image against pixels a side, and against the mesh's triangles, on which no field depends."""
    sides: dict[str, list[tuple[float, float]]] = {}
    for row in by_size:
        sides.setdefault(row["what"], []).append((row["size"]["pixels_a_side"], row["ms_per_image"]))
    faces = [(row["size"]["triangles"], row["ms_per_image"]) for row in by_faces]
    flat = {name: [(count, dict(line)[COMPARED]) for count, _ in faces] for name, line in sides.items()}
    panels = [
        ("Resolution", "pixels a side", sides),
        (f"Mesh at {COMPARED} × {COMPARED}; no field depends on it", "triangles", flat | {CASTING: faces}),
    ]
    growth_curves.draw("rendering", panels, "ms per image")


def _of_networks(row: results.Row) -> bool:
    """Images of the compared size, but for the mesh itself, which takes a small part of the time at no error."""
    return "times_ddf" in row.told and row.what != "mesh casting"


def rendering_sentence(benchmark: results.Benchmark) -> str | None:
    """The DDF, of every pixel and refined, against sphere tracing that is as good, and against casting the mesh."""
    rows = [row for row in benchmark.rows if row.seconds and "times_ddf" in row.told]
    own = next((row for row in rows if row.what == "DDF"), None)
    if own is None:
        return None
    refined = next((row for row in rows if row.what == "DDF, refined"), None)
    casting = next((row for row in rows if row.what == "mesh casting"), None)
    rivals = [row for row in rows if row.what.startswith("sphere tracing")]
    parts = [_against(own, [row for row in rivals if not row.what.endswith("refined")])]
    if refined:
        parts.append(_against(refined, rivals))
    if casting:
        parts.append(_rendering_words(casting))
    return f"**Rendering**, {own.size['pixels_a_side']} pixels a side: {'; '.join(parts)}."


def _against(own: results.Row, rivals: Sequence[results.Row]) -> str:
    """A way of drawing, and the fastest of `rivals` whose depth and visibility are as good."""
    good = [
        row
        for row in rivals
        if all(row.error[name] <= own.error[name] for name in ("depth_median", "wrong_visibility"))
    ]
    words = _rendering_words(own)
    if good:
        best = display.fastest(good)
        return (
            f"{words}, the fastest tracing as good, {_rendering_words(best)}, {display.times(best, own)} times as long"
        )
    words += ", no sphere tracing of a network of the same size as good"
    if not rivals:
        return words
    nearest = min(rivals, key=lambda row: row.error["depth_median"])
    return f"{words}, nearest {_rendering_words(nearest)}, {display.times(nearest, own)} times as long"


def _rendering_words(row: results.Row) -> str:
    time = display.number(1e3 * row.seconds[1]) if row.seconds else "–"
    return f"{row.what} ({time} ms, median error of depth {display.number(row.error['depth_median'])})"


SECTION = display.Section(
    views=(display.View("depth_median", "median error of depth", keep=_of_networks),),
    headline=rendering_sentence,
)


def main() -> None:
    """Train, measure, write, and say how the DDF compares."""
    measuring.write("rendering", THREADS, measure())
    print(rendering_sentence(results.load(measuring.OUT / "rendering.json")))

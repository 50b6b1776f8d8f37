"""What a fitted field is beside the truth: errors, renders from four cameras, two of them inside, and slices.

The truth is cast against the mesh that was fitted, for the same rays. Depths of one row are on one colour scale.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from ddf.core import provenance, seeding, storage
from ddf.data.samples.draws import Surface
from ddf.fields import field_values, framed_field, model_files, shape_field
from ddf.fields.shape_field import ShapeField
from ddf.fit import field_diagnostics, fit_settings, fitting
from ddf.geometry import raycast, rays
from ddf.geometry.mesh_io import Mesh
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.evaluation import shape_fits

VIEWS, SLICES, VIEW_RECORD, DIAGNOSTICS = "views.webp", "slices.webp", "views.json", "diagnostics.json"
PICTURE_SIZE, RAYS = 168, 20_000  # pixels a side; random rays that the diagnostics are over
OUTSIDE = (("outside", (35.0, 25.0, 0.8)), ("from behind", (215.0, 15.0, 0.8)))  # azimuth, elevation in degrees, radius
VIEW_COLUMNS = ("visibility", "depth", "true depth", "normals", "true normals", "mean curv.", "w₁", "n₁", "n₂")
_RENDERED = ("visibility", "depth", "normals", "mean_curvature", "weight_1", "normals_1", "normals_2")
# v of each row as in the paper's fig. 1, and where along z the planes of the columns lie, as shares of the box
SLICE_DIRECTIONS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0))
SLICE_LEVELS = (0.3, 0.5)
_SLICED = ("visibility", "weight_1", "depth")
SLICE_COLUMNS = ("ξ", "w₁", "d", "true d")
_CANDIDATES = 2048  # points that the cameras inside the box and inside the shape are chosen from
_PROBES = 64  # directions in which a point must be shut in to be inside
_LIFT = 1e-3  # of the box's diagonal: a ray into the shape starts so far below its surface


@dataclass(frozen=True)
class View:
    """A named camera of `framed_field.camera_rays` and the images that a field gives from it.

    camera: azimuth and elevation in degrees, radius in benchmark units. evaluated: rays that met the box.
    """

    name: str
    camera: tuple[float, float, float]
    images: dict[str, Float[np.ndarray, "size size ..."]]
    evaluated: int

    def summary(self) -> dict[str, Any]:
        """Name, camera, rays, how many were evaluated, saved by the box and seen."""
        visibility = self.images["visibility"]
        return {
            "name": self.name,
            "camera": list(self.camera),
            "rays": visibility.size,
            "evaluated": self.evaluated,
            "saved": visibility.size - self.evaluated,
            "seen": int((visibility >= framed_field.SEEN).sum()),
        }


def cameras(shape: ShapeField, scene: raycast.Scene, seed: int) -> list[tuple[str, tuple[float, float, float]]]:
    """Names and cameras: two outside, one in the box but not in the shape, one in the shape where it has an inside."""
    random = seeding.generator(seed, "shape_views")
    mesh_from_field = shape.field_from_mesh.inverse()
    anywhere = mesh_from_field.apply(random.uniform(shape.lower, shape.upper, (_CANDIDATES, 3)))
    places = {"in the box": _farthest(scene, anywhere[scene.outside(anywhere)])}
    places["in the shape"] = _farthest(scene, _inner_points(scene, random))
    found = list(OUTSIDE)
    for name, place in places.items():
        if place is not None:
            found.append((name, framed_field.camera_at(shape, shape.field_from_mesh.apply(place))))
    return found


def _inner_points(scene: raycast.Scene, random: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Middles of chords from the surface along ∓n: those that the surface encloses best, seen in `_PROBES` directions.

    No parity and no orientation, so that doubled, flipped and open parts of collected meshes do no harm.
    """
    points, face = Surface.of(scene.mesh).draw(_CANDIDATES // 2, random)
    inwards = np.concatenate([-scene.normals[face], scene.normals[face]])
    starts = np.concatenate([points, points]) + _LIFT * scene.mesh.diagonal() * inwards
    depth, _ = scene.first_hits(starts, inwards)
    met = np.isfinite(depth)
    middles = starts[met] + 0.5 * depth[met, None] * inwards[met]
    if not len(middles):
        return middles
    probes = rays.evenly_spread(_PROBES)
    along = np.tile(probes, (len(middles), 1))
    blocked = scene.blocked_local(scene.local(np.repeat(middles, _PROBES, axis=0)), along)
    share = blocked.reshape(len(middles), _PROBES).mean(axis=1)
    return middles[share == share.max()]


def _farthest(scene: raycast.Scene, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3"] | None:
    """The point farthest from the surface; None of no points."""
    return points[np.argmax(scene.distance(points))] if len(points) else None


def render(shape: ShapeField, mesh: Mesh, size: int, seed: int) -> list[View]:
    """The images of every camera; depth in mesh units, and the truth as `true_depth`, `true_normals`.

    Args:
      mesh: in its own frame, the one that was fitted.
    """
    scene = raycast.Scene(mesh)
    views = []
    for name, camera in cameras(shape, scene, seed):
        images, evaluated = framed_field.render(shape, camera, size, _RENDERED)
        starts, directions = framed_field.camera_rays(shape, camera, size)
        hits = _truth(shape, scene, starts, directions)
        images["true_depth"] = hits.depth.numpy().reshape(size, size)
        images["true_normals"] = hits.normals.numpy().reshape(size, size, 3)
        views.append(View(name, camera, images, evaluated))
    return views


def _truth(
    shape: ShapeField, scene: raycast.Scene, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
) -> rays.RayHits:
    """First hits of field-frame rays, in the mesh's frame and unit."""
    mesh_from_field = shape.field_from_mesh.inverse()
    moved = (mesh_from_field.apply(positions), mesh_from_field.apply_directions(directions))
    return raycast.cast(scene, rays.OrientedPoints(*map(torch.from_numpy, moved)))


def view_strip(views: list[View]) -> bytes:
    """One row per camera, columns as in `VIEW_COLUMNS`, as WebP."""
    rows = []
    for view in views:
        images = view.images
        true_seen = np.isfinite(images["true_depth"]).astype(np.float64)
        depth, true_depth = field_pictures.depth_pictures(images["depth"], images["true_depth"])
        true_normals = field_pictures.normals_picture(images["true_normals"], true_seen)
        own = {name: field_pictures.picture(name, images) for name in _RENDERED if name != "depth"}
        cells = [own["visibility"], depth, true_depth, own["normals"], true_normals]
        cells += [own[name] for name in ("mean_curvature", "weight_1", "normals_1", "normals_2")]
        azimuth, elevation, radius = view.camera
        lines = [f"{azimuth:.0f}°, {elevation:.0f}°, {radius:.2f}", f"{view.evaluated:,} rays"]
        rows.append(picture_strips.StripRow(view.name, lines, cells))
    return picture_strips.strip(VIEW_COLUMNS, rows, per_line=5)


@torch.no_grad()
def slice_images(
    shape: ShapeField, scene: raycast.Scene, level: float, direction: tuple[float, float, float], size: int
) -> dict[str, Float[np.ndarray, "size size"]]:
    """visibility, weight_1, depth and true_depth of points p in a plane z = const of the field frame, v fixed.

    x runs to the right and y upwards over the square around the box. Outside the box the field is not defined:
    visibility is 0 there, depths are `inf`.

    Args:
      level: where the plane lies between the box's lower (0) and upper (1) side. direction: v, of any length.
    """
    centre, half = (shape.lower + shape.upper) / 2, float((shape.upper - shape.lower)[:2].max()) / 2
    steps = ((np.arange(size) + 0.5) / size * 2 - 1) * half
    x, y = np.meshgrid(centre[0] + steps, centre[1] - steps)
    z = np.full_like(x, shape.lower[2] + level * (shape.upper[2] - shape.lower[2]))
    positions = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    directions = np.tile(np.array(direction) / math.hypot(*direction), (len(positions), 1))
    inside = ((positions >= shape.lower) & (positions <= shape.upper)).all(axis=1)
    weight = shape.field.network.head.weight
    asked = [
        torch.from_numpy(values[inside]).to(weight).split(framed_field.CHUNK_RAYS) for values in (positions, directions)
    ]
    parts = [field_values.evaluate(shape.field, p, v, _SLICED) for p, v in zip(*asked, strict=True)]
    images = {name: np.full(len(positions), np.inf if name == "depth" else 0.0) for name in _SLICED}
    for name, values in images.items():
        values[inside] = torch.cat([part[name] for part in parts]).double().cpu().numpy()
    images["depth"][images["visibility"] < framed_field.SEEN] = np.inf
    hits = _truth(shape, scene, positions, directions)
    images["true_depth"] = np.where(inside, hits.depth.numpy() * shape.field_from_mesh.scale, np.inf)
    return {name: values.reshape(size, size) for name, values in images.items()}


def slice_strip(shape: ShapeField, mesh: Mesh, size: int) -> bytes:
    """One row per direction, for each plane the columns of `SLICE_COLUMNS`, as WebP."""
    scene = raycast.Scene(mesh)
    rows = []
    for direction in SLICE_DIRECTIONS:
        cells: list[picture_strips.Picture | None] = []
        for level in SLICE_LEVELS:
            images = slice_images(shape, scene, level, direction, size)
            visibility = field_pictures.visibility_picture(images["visibility"])
            weight = field_pictures.weight_picture(images["weight_1"], images["visibility"])
            cells += [visibility, weight, *field_pictures.depth_pictures(images["depth"], images["true_depth"])]
        rows.append(picture_strips.StripRow("v along", [f"({', '.join(f'{part:.0f}' for part in direction)})"], cells))
    return picture_strips.strip(
        [f"{name}, z {100 * level:.0f} %" for level in SLICE_LEVELS for name in SLICE_COLUMNS], rows
    )


def write(mesh: Mesh, fit: fit_settings.FitConfig, out_dir: Path) -> None:
    """fit.csv, diagnostics.json, views.webp, slices.webp and views.json of the field in `out_dir`.

    Args:
      mesh: in its own frame, the one that was fitted.
    """
    shape, seed = shape_field.load(out_dir), fit.loop.seed
    record = provenance.record([fit], seed, [out_dir / model_files.MODEL], __name__)
    held_out = storage.read_json(out_dir / fitting.METRICS)["held_out"]
    storage.save_table(out_dir / shape_fits.FIT, shape_fits.fit_table(held_out), record)
    storage.write_json(out_dir / DIAGNOSTICS, field_diagnostics.measure(shape, RAYS, seed))
    views = render(shape, mesh, PICTURE_SIZE, seed)
    storage.write_bytes(out_dir / VIEWS, view_strip(views))
    storage.write_bytes(out_dir / SLICES, slice_strip(shape, mesh, PICTURE_SIZE))
    storage.write_json(out_dir / VIEW_RECORD, [view.summary() for view in views])

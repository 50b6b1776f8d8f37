"""What a fitted field is beside the truth: errors, renders from three cameras, one of them inside, and slices."""

from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ddf.core import provenance, seeding, storage
from ddf.fields import framed_field, model_files, shape_field
from ddf.fields.shape_field import ShapeField
from ddf.fit import field_diagnostics, fit_folder, fit_settings
from ddf.geometry import raycast
from ddf.geometry.mesh_io import Mesh
from ddf.pictures import picture_strips
from ddf_lab.evaluation import shape_fits
from ddf_lab.report import beside

VIEWS, SLICES, DIAGNOSTICS = "views.webp", "slices.webp", "diagnostics.json"
PICTURE_SIZE, RAYS = 168, 20_000  # pixels a side; random rays that the diagnostics are over
OUTSIDE = (("outside", (35.0, 25.0, 0.8)), ("from behind", (215.0, 15.0, 0.8)))  # azimuth, elevation in degrees, radius
# v of each row as in the paper's fig. 1, and where along z the planes of the columns lie, as shares of the box
DIRECTIONS = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0))
SLICE_LEVELS = (0.3, 0.5)
SLICED = {"visibility": "ξ", "weight_1": "w₁", "depth": "d", "true_depth": "exact d"}
_CANDIDATES = 2048  # points that the camera inside the box is chosen from


class View(NamedTuple):
    """A named camera of `framed_field.camera_rays` and what is found from it (`beside`).

    camera: azimuth and elevation in degrees, radius in benchmark units. evaluated: rays that met the box.
    """

    name: str
    camera: beside.Vector
    found: dict[str, Float[np.ndarray, "n ..."]]
    evaluated: int


def cameras(shape: ShapeField, scene: raycast.Scene, seed: int) -> list[tuple[str, beside.Vector]]:
    """Names and cameras: two outside, one in the box but not in the shape, where the surface is farthest."""
    random = seeding.generator(seed, "shape_views")
    anywhere = shape.field_from_mesh.inverse().apply(random.uniform(shape.lower, shape.upper, (_CANDIDATES, 3)))
    free = anywhere[scene.outside(anywhere)]
    inner = [free[np.argmax(scene.distance(free))]] if len(free) else []
    places = [("in the box", framed_field.camera_at(shape, shape.field_from_mesh.apply(place))) for place in inner]
    return [*OUTSIDE, *places]


def render(shape: ShapeField, mesh: Mesh, size: int, seed: int) -> list[View]:
    """What is found from every camera; the mesh is the one that was fitted, in its own frame."""
    scene, views = raycast.Scene(mesh), []
    for name, camera in cameras(shape, scene, seed):
        points = beside.camera(shape, camera, size)
        views.append(View(name, camera, *beside.ask(shape, partial(raycast.cast, scene), points, beside.TITLES)))
    return views


def view_strip(views: list[View]) -> bytes:
    """One row per camera, columns as in `beside.TITLES`, as WebP."""
    rows = []
    for view in views:
        azimuth, elevation, radius = view.camera
        lines = [f"{azimuth:.0f}°, {elevation:.0f}°, {radius:.2f}", f"{view.evaluated:,} rays"]
        rows.append(picture_strips.StripRow(view.name, lines, beside.pictures(view.found, beside.TITLES)))
    return picture_strips.strip(list(beside.TITLES.values()), rows, per_line=5)


def slice_of(
    shape: ShapeField, scene: raycast.Scene, level: float, direction: beside.Vector, size: int
) -> dict[str, Float[np.ndarray, "n ..."]]:
    """What is found at the points of `beside.plane`, all with one direction. Outside the box nothing is seen."""
    points, (low, high) = beside.along(beside.plane(shape, level, size), direction), beside.corners(shape)
    found, _ = beside.ask(shape, partial(raycast.cast, scene), points, SLICED)
    outside = ((points.positions < low) | (points.positions > high)).any(axis=1)
    for name, nothing in (("visibility", 0.0), ("depth", np.inf), ("true_depth", np.inf)):
        found[name] = np.where(outside, nothing, found[name])
    return found


def slice_strip(shape: ShapeField, mesh: Mesh, size: int) -> bytes:
    """One row per direction, for each plane the columns of `SLICED`, as WebP."""
    scene, rows = raycast.Scene(mesh), []
    for direction in DIRECTIONS:
        found = [slice_of(shape, scene, level, direction, size) for level in SLICE_LEVELS]
        cells = [cell for each in found for cell in beside.pictures(each, SLICED)]
        rows.append(picture_strips.StripRow("v along", [named(direction)], cells))
    titles = [f"{name}, z {100 * level:.0f} %" for level in SLICE_LEVELS for name in SLICED.values()]
    return picture_strips.strip(titles, rows)


def named(direction: beside.Vector) -> str:
    """As it stands above pictures."""
    return f"({', '.join(f'{part:g}' for part in direction)})"


def write(mesh: Mesh, fit: fit_settings.FitConfig, out_dir: Path) -> None:
    """fit.csv, diagnostics.json, views.webp and slices.webp of the field in `out_dir`.

    Args:
      mesh: in its own frame, the one that was fitted.
    """
    shape, seed = shape_field.load(out_dir), fit.loop.seed
    record = provenance.record([fit], seed, [out_dir / model_files.MODEL], __name__)
    held_out = storage.read_json(out_dir / fit_folder.METRICS)["held_out"]
    storage.save_table(out_dir / shape_fits.FIT, shape_fits.fit_table(held_out), record)
    storage.write_json(out_dir / DIAGNOSTICS, field_diagnostics.measure(shape, RAYS, seed))
    storage.write_bytes(out_dir / VIEWS, view_strip(render(shape, mesh, PICTURE_SIZE, seed)))
    storage.write_bytes(out_dir / SLICES, slice_strip(shape, mesh, PICTURE_SIZE))

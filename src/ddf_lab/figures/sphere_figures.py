"""Two spheres: how the weight w_1 lets a smooth network jump, in renders and slices; n_1 and n_2 see through.

[DDF22] figs. `prob_illus`, `seethrough`, `discontillus` and the slices of fig. 1, against the closed form.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch

from ddf.fields import framed_field
from ddf.fields.shape_field import ShapeField
from ddf.geometry import primitives, rays
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import figures, pages

CAMERAS = ((90.0, 15.0, 0.9), (35.0, 15.0, 0.9), (8.0, 15.0, 0.9))  # azimuth, elevation in degrees, radius
SLICES = (((0.0, 0.0, -1.0), "(0, 0, -1)"), ((1.0, 0.0, 0.0), "(1, 0, 0)"), ((1.0, 1.0, 1.0), "(1, 1, 1)"))
LINES = {  # first and last p, v
    "surface discontinuity": ((-1.25, 0.0), (1.0, 0.0), (1.0, 0.0)),
    "occlusion discontinuity": ((-1.0, -0.85), (-1.25, 0.45), (0.98, 0.2)),
}
_ASKED = ("visibility", "depth", "weight_1", "normals", "normals_1", "normals_2")
_COLUMNS = ("depth", "exact depth", "w_1", "normals", "n_1", "n_2")
_EDGE = 0.03  # on either side of where the truth jumps, field units


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Renders and slices in one strip, and errors beside and away from the jumps."""
    field, size = figure_fields.fitted("two_spheres", config, folder), config.picture_size
    rows = []
    for camera in CAMERAS:
        starts, directions = framed_field.camera_rays(field, camera, size)
        back = field.field_from_mesh.inverse()
        points = rays.OrientedPoints(back.apply(starts), back.apply_directions(directions))
        rows.append(_row(f"render, azimuth {camera[0]:g}°", field, points, size))
    for direction, name in SLICES:
        rows.append(_row(f"slice z = 0, v ∥ {name}", field, _slice(field, direction, size), size))
    strip = picture_strips.strip(_COLUMNS, rows, per_line=len(_COLUMNS))
    return pages.Section(
        "Two spheres, and jumps",
        [
            pages.Figure(
                "spheres.webp",
                "w_1 red: d_1 is the depth; blue: d_2. Where it turns, depth may jump: at occlusion edges, and in"
                " slices where p passes through the surface. n_2 shows what lies behind where d_2 is the lighter one.",
                "Depth, exact depth, weight and normals of both components, in renders and slices",
                strip,
            ),
            pages.Figure(
                "jumps.svg",
                "Depth at the starts of the arrows, as they move. Left, through the surface: d falls to 0 and begins"
                " anew. Right, past the rim of the nearer sphere: d jumps to the farther one. A smooth network jumps"
                " where w₁ passes 1/2; gaps see nothing.",
                "Sketches of both kinds of discontinuities, depths of field and closed form along a line, and w₁",
                figures.jumps({title: _along(field, *each) for title, each in LINES.items()}).encode(),
            ),
            _table(field),
            "Answers [DDF22] figs. `prob_illus`, `seethrough`, `discontillus`, and fig. 1's slices.",
        ],
    )


def _slice(field: ShapeField, direction: tuple[float, float, float], size: int) -> rays.OrientedPoints[np.ndarray]:
    """Positions of the plane z = 0 of the box, all along one direction."""
    corners = field.field_from_mesh.inverse().apply(np.stack([field.lower, field.upper]))
    half = float(np.ptp(corners, axis=0).max()) / 2
    steps = half * (2 * (np.arange(size) + 0.5) / size - 1)
    y, x = np.meshgrid(-steps, steps, indexing="ij")
    positions = corners.mean(axis=0) + np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    unit = np.array(direction) / np.linalg.norm(direction)
    return rays.OrientedPoints(positions, np.broadcast_to(unit, positions.shape).copy())


def _along(
    field: ShapeField, first: tuple[float, float], last: tuple[float, float], along: tuple[float, float]
) -> tuple[dict[str, Any], list[tuple[float, ...]], list[tuple[float, ...]]]:
    """What `figures.jumps` shows of a line of positions in the plane z = 0, all with one direction."""
    shares = np.linspace(0.0, 1.0, 600)
    ends, v = np.array([first, last]), np.array(along) / np.hypot(*along)
    positions = np.pad(ends[0] + shares[:, None] * (ends[1] - ends[0]), ((0, 0), (0, 1)))
    points = rays.OrientedPoints(positions, np.broadcast_to(np.append(v, 0.0), positions.shape).copy())
    found, _ = framed_field.query(field, points, ("visibility", "depth", "weight_1"))
    exact = _exact(points).depth.numpy()
    shown = {"depth": found["depth"], "weight": np.where(np.isfinite(found["depth"]), found["weight_1"], np.inf)}
    seen = {name: np.where(np.isfinite(values), values, np.nan) for name, values in {**shown, "exact": exact}.items()}
    place = shares * float(np.linalg.norm(ends[1] - ends[0]))
    parts = primitives.two_spheres().parts
    circles = [(*part.centre[:2], part.radius) for part in parts if isinstance(part, primitives.Sphere)]
    arrows = [(*each[:2], *(0.3 * v)) for each in positions[:: len(positions) // 5]]
    return {**seen, "place": place, "name": "way of p"}, circles, arrows


def _exact(points: rays.OrientedPoints[np.ndarray]) -> rays.RayHits:
    tensors = rays.OrientedPoints(torch.from_numpy(points.positions), torch.from_numpy(points.directions))
    return primitives.cast(primitives.two_spheres(), tensors)


def _row(
    heading: str, field: ShapeField, points: rays.OrientedPoints[np.ndarray], size: int
) -> picture_strips.StripRow:
    found, _ = framed_field.query(field, points, _ASKED)
    images = {name: values.reshape(size, size, *values.shape[1:]) for name, values in found.items()}
    depth, true = field_pictures.depth_pictures(images["depth"], _exact(points).depth.numpy().reshape(size, size))
    others = [field_pictures.picture(name, images) for name in ("weight_1", "normals", "normals_1", "normals_2")]
    hits = _exact(points)
    both = np.isfinite(found["depth"]) & hits.visible.numpy()
    error = np.median(np.abs(found["depth"][both] - hits.depth.numpy()[both]))
    return picture_strips.StripRow(heading, (f"median depth error {error:.4f}",), [depth, true, *others])


def _table(field: ShapeField, count: int = 40_000) -> pages.Table:
    """Errors near and far from occlusion edges, of random rays: an edge is where a ray turned a little jumps."""
    random = np.random.default_rng(0)
    corners = field.field_from_mesh.inverse().apply(np.stack([field.lower, field.upper]))
    positions = random.uniform(corners[0], corners[1], (count, 3))
    directions = random.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = rays.OrientedPoints(positions, directions)
    found, _ = framed_field.query(field, points, ("visibility", "depth", "weight_1"))
    depth = _exact(points).depth.numpy()
    jump = np.zeros(count, dtype=bool)
    for axis in np.eye(3):
        moved = _exact(rays.OrientedPoints(positions + _EDGE * axis, directions)).depth.numpy()
        with np.errstate(invalid="ignore"):  # where both are inf
            jump |= np.isfinite(depth) & (~np.isfinite(moved) | (np.abs(moved - depth) > 5 * _EDGE))
    both, rows = np.isfinite(depth) & np.isfinite(found["depth"]), []
    off = np.zeros(count)
    off[both] = np.abs(found["depth"][both] - depth[both])
    for name, chosen in (("beside a jump", both & jump), ("elsewhere", both & ~jump)):
        mixed = np.abs(found["weight_1"][chosen] - 0.5) < 0.4
        values = (off[chosen].mean(), np.median(off[chosen]), 100 * mixed.mean())
        rows.append([name, f"{chosen.sum():,}", f"{values[0]:.4f}", f"{values[1]:.4f}", f"{values[2]:.1f}"])
    return pages.Table(
        f"Random rays that field and truth see. A jump: moving p by {_EDGE} loses the surface or changes depth by more"
        " than five times that. Undecided: w_1 between 0.1 and 0.9.",
        ["rays", "number", "mean depth error", "median", "undecided, %"],
        rows,
    )

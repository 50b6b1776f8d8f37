"""Two spheres: how the weight w_1 lets a smooth network jump, in renders and slices; n_1 and n_2 see through.

[DDF22] figs. `prob_illus`, `seethrough`, `discontillus` and the slices of fig. 1, against the closed form.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch

from ddf.fields.shape_field import ShapeField
from ddf.geometry import primitives, rays
from ddf.pictures import picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import beside, figures, pages, shape_views

CAMERAS = ((90.0, 15.0, 0.9), (35.0, 15.0, 0.9), (8.0, 15.0, 0.9))  # azimuth, elevation in degrees, radius
LINES = {  # first and last p, v, in the plane z = 0
    "surface discontinuity": ((-1.25, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
    "occlusion discontinuity": ((-1.0, -0.85, 0.0), (-1.25, 0.45, 0.0), (0.98, 0.2, 0.0)),
}
_SHOWN = ("depth", "true_depth", "weight_1", "normals", "normals_1", "normals_2")


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Renders and slices in one strip, and jumps along lines."""
    field, size = figure_fields.fitted("two_spheres", config, folder), config.picture_size
    asked = {f"render, azimuth {camera[0]:g}°": beside.camera(field, camera, size) for camera in CAMERAS}
    for direction in shape_views.DIRECTIONS:
        name = f"slice z = 0, v ∥ {shape_views.named(direction)}"
        asked[name] = beside.along(beside.plane(field, 0.5, size), direction)
    rows = []
    for name, points in asked.items():
        found, _ = beside.ask(field, _exact, points, _SHOWN)
        said = f"median depth error {beside.errors(found)['median']:.4f}"
        rows.append(picture_strips.StripRow(name, (said,), beside.pictures(found, _SHOWN)))
    strip = pages.Figure(
        "spheres.webp",
        "w₁ red: d_1 is the depth; blue: d_2. Where it turns, depth may jump: at occlusion edges, and in slices where"
        " p passes through the surface. n₂ shows what lies behind where d_2 is the lighter one.",
        "Depth, exact depth, weight and normals of both components, in renders and slices",
        picture_strips.strip([beside.TITLES[name] for name in _SHOWN], rows, per_line=len(_SHOWN)),
    )
    jumps = pages.Figure(
        "jumps.svg",
        "Depth at the starts of the arrows, as they move. Left, through the surface: d falls to 0 and begins anew."
        " Right, past the rim of the nearer sphere: d jumps to the farther one. A smooth network jumps where w₁ passes"
        " 1/2; gaps see nothing.",
        "Sketches of both kinds of discontinuities, depths of field and closed form along a line, and w₁",
        figures.jumps({title: _along(field, *each) for title, each in LINES.items()}).encode(),
    )
    answer = "Answers [DDF22] figs. `prob_illus`, `seethrough`, `discontillus`, and fig. 1's slices."
    return pages.Section("Two spheres, and jumps", [strip, jumps, answer])


def _along(
    field: ShapeField, first: beside.Vector, last: beside.Vector, v: beside.Vector
) -> tuple[dict[str, Any], list[tuple[float, ...]], list[tuple[float, ...]]]:
    """What `figures.jumps` shows of a line of positions, all with one direction."""
    points = beside.along(np.linspace(first, last, 600), v)
    found, _ = beside.ask(field, _exact, points, ("depth", "weight_1"))
    seen = np.isfinite(found["depth"])
    shown = {"depth": seen, "weight_1": seen, "true_depth": np.isfinite(found["true_depth"])}
    values = {name: np.where(where, found[name], np.nan) for name, where in shown.items()}
    place = np.linalg.norm(points.positions - points.positions[0], axis=1)
    parts = primitives.two_spheres().parts
    circles = [(*part.centre[:2], part.radius) for part in parts if isinstance(part, primitives.Sphere)]
    starts, ways = (each[::120, :2] for each in (points.positions, 0.3 * points.directions))
    return {**values, "place": place, "name": "way of p"}, circles, np.hstack([starts, ways]).tolist()


def _exact(points: beside.Points) -> rays.RayHits[np.ndarray]:
    tensors = rays.OrientedPoints(torch.from_numpy(points.positions), torch.from_numpy(points.directions))
    hits = primitives.cast(primitives.two_spheres(), tensors)
    return rays.RayHits(*(each.numpy() for each in (hits.depth, hits.visible, hits.normals, hits.face)))

"""Two spheres: how the weight w_1 lets a smooth network jump, in renders and slices; n_1 and n_2 see through.

[DDF22] figs. `prob_illus`, `seethrough` and the slices of fig. 1, against the closed form.
"""

from pathlib import Path

import numpy as np
import torch

from ddf.geometry import primitives, rays
from ddf.pictures import picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import beside, pages, shape_views

CAMERAS = ((90.0, 15.0, 0.9), (35.0, 15.0, 0.9), (8.0, 15.0, 0.9))  # azimuth, elevation in degrees, radius
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
    answer = "Answers [DDF22] figs. `prob_illus`, `seethrough`, and fig. 1's slices."
    return pages.Section("Two spheres, and jumps", [strip, answer])


def _exact(points: beside.Points) -> rays.RayHits[np.ndarray]:
    tensors = rays.OrientedPoints(torch.from_numpy(points.positions), torch.from_numpy(points.directions))
    hits = primitives.cast(primitives.two_spheres(), tensors)
    return rays.RayHits(*(each.numpy() for each in (hits.depth, hits.visible, hits.normals, hits.face)))

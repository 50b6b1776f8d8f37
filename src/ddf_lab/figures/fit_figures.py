"""Fits beside the truth. Several shapes: depth, normals and mean curvature from several cameras.

One query a pixel; derivatives are those of the same oriented points; truth: rays cast against the mesh. Two spheres:
how the weight w_1 lets a smooth network jump, in renders and slices; n_1 and n_2 see through; truth: the closed form.
Source: [DDF22] figs. `singobjfits`, `prob_illus`, `seethrough` and the slices of fig. 1.
"""

from functools import partial
from pathlib import Path

import numpy as np
import torch

from ddf.data.synthetic import showcase
from ddf.fit import inspection, patch_fitting
from ddf.geometry import primitives, raycast, rays
from ddf.pictures import picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import beside, pages, shape_views

NAMES = ("rabbit", "armchair", "airliner", "nested")
SHAPES_FROM = ((35.0, 25.0, 0.9), (160.0, 15.0, 0.9))
_OF_SHAPES = ("depth", "true_depth", "normals", "true_normals", "mean_curvature")
SPHERES_FROM = ((90.0, 15.0, 0.9), (35.0, 15.0, 0.9), (8.0, 15.0, 0.9))  # azimuth, elevation in degrees, radius
_OF_SPHERES = ("depth", "true_depth", "weight_1", "normals", "normals_1", "normals_2")


def shapes_section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """A line of pictures per camera, errors per shape."""
    strips, lines, inner, size = [], [], {True: [], False: []}, config.picture_size
    for name in NAMES:
        network, mesh = figure_fields.fitted(name, config, folder), showcase.SHAPES[name]()
        truth = partial(raycast.cast, raycast.Scene(mesh))
        for what, field in ((name, network), (f"{name}, patches", patch_fitting.patches(mesh))):
            views = [beside.ask(field, truth, beside.camera(field, each, size), _OF_SHAPES) for each in SHAPES_FROM]
            if field is network:  # pictures of the paper's kind
                for camera, (found, _) in zip(SHAPES_FROM, views, strict=True):
                    heading, cells = f"{name}, azimuth {camera[0]:g}°", beside.pictures(found, _OF_SHAPES)
                    strips.append(picture_strips.StripRow(heading, ("one query a pixel",), cells))
            errors = [beside.errors(found) for found, _ in views]
            depth, angle, wrong = (np.mean([own[key] for own in errors]) for key in ("median", "angle", "wrong"))
            inside = inspection.wrong_inside(field, inspection.beside(field, mesh))
            inner[field is network].append(inside)
            asked = np.mean([evaluated for _, evaluated in views]) / size**2
            cells = [f"{field.field_from_mesh.scale * depth:.5f}", f"{angle:.1f}", f"{100 * wrong:.1f}"]
            lines.append([what, *cells, f"{inside:.1f}", f"{asked:.2f}"])
    figure = pages.Figure(
        "fits.webp",
        "Curvature: blue is convex, red is concave. Right: what is seen from outside. Interior error: networks err on"
        f" {min(inner[True]):.0f} to {max(inner[True]):.0f} % of rays, patches on {min(inner[False]):.1f} to"
        f" {max(inner[False]):.1f} %.",
        "Depth, normals and mean curvature of four shapes from two cameras",
        picture_strips.strip([beside.TITLES[name] for name in _OF_SHAPES], strips, per_line=len(_OF_SHAPES)),
    )
    table = pages.Table(
        "Means over the cameras: median |depth - exact| (longest side about 2) and angle where both see the shape,"
        " share of pixels where only one does, queries a pixel. Interior error: rays from anywhere in the box that end"
        " elsewhere than the mesh says, by more than 1 % of its longest side.",
        ["shape", "depth", "normals, °", "visibility error, %", "interior error, %", "queries a pixel"],
        lines,
    )
    return pages.Section("Fits of several shapes", [figure, table, "Answers [DDF22] fig. `singobjfits`."])


def spheres_section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Renders and slices in one strip, and jumps along lines."""
    field, size = figure_fields.fitted("two_spheres", config, folder), config.picture_size
    asked = {f"render, azimuth {camera[0]:g}°": beside.camera(field, camera, size) for camera in SPHERES_FROM}
    for direction in shape_views.DIRECTIONS:
        name = f"slice z = 0, v ∥ {shape_views.named(direction)}"
        asked[name] = beside.along(beside.plane(field, 0.5, size), direction)
    rows = []
    for name, points in asked.items():
        found, _ = beside.ask(field, _exact, points, _OF_SPHERES)
        said = f"median depth error {beside.errors(found)['median']:.4f}"
        rows.append(picture_strips.StripRow(name, (said,), beside.pictures(found, _OF_SPHERES)))
    strip = pages.Figure(
        "spheres.webp",
        "w₁ red: d_1 is the depth; blue: d_2. Where it turns, depth may jump: at occlusion edges, and in slices where"
        " p passes through the surface. n₂ shows what lies behind where d_2 is the lighter one.",
        "Depth, exact depth, weight and normals of both components, in renders and slices",
        picture_strips.strip([beside.TITLES[name] for name in _OF_SPHERES], rows, per_line=len(_OF_SPHERES)),
    )
    answer = "Answers [DDF22] figs. `prob_illus`, `seethrough`, and fig. 1's slices."
    return pages.Section("Two spheres, and jumps", [strip, answer])


def _exact(points: beside.Points) -> rays.RayHits[np.ndarray]:
    tensors = rays.OrientedPoints(torch.from_numpy(points.positions), torch.from_numpy(points.directions))
    hits = primitives.cast(primitives.two_spheres(), tensors)
    return rays.RayHits(*(each.numpy() for each in (hits.depth, hits.visible, hits.normals, hits.face)))

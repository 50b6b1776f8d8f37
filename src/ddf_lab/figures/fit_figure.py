"""Fits of several shapes: depth, normals and mean curvature from several cameras. [DDF22] fig. `singobjfits`.

One query a pixel; derivatives are those of the same oriented points. Truth: rays cast against the mesh.
"""

from functools import partial
from pathlib import Path

import numpy as np

from ddf.data.synthetic import showcase
from ddf.fit import inspection
from ddf.geometry import raycast
from ddf.pictures import picture_strips
from ddf_lab.figures import drawing, figure_fields
from ddf_lab.report import beside, pages

NAMES = ("rabbit", "armchair", "airliner", "nested")
CAMERAS = ((35.0, 25.0, 0.9), (160.0, 15.0, 0.9))
_SHOWN = ("depth", "true_depth", "normals", "true_normals", "mean_curvature")


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """A line of pictures per camera, errors per shape."""
    strips, lines, inner, size = [], [], {True: [], False: []}, config.picture_size
    for name in NAMES:
        network, mesh = figure_fields.fitted(name, config, folder), showcase.SHAPES[name]()
        truth = partial(raycast.cast, raycast.Scene(mesh))
        for what, field in ((name, network), (f"{name}, patches", drawing.patches(mesh))):
            views = [beside.ask(field, truth, beside.camera(field, each, size), _SHOWN) for each in CAMERAS]
            if field is network:  # pictures of the paper's kind
                for camera, (found, _) in zip(CAMERAS, views, strict=True):
                    heading, cells = f"{name}, azimuth {camera[0]:g}°", beside.pictures(found, _SHOWN)
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
        picture_strips.strip([beside.TITLES[name] for name in _SHOWN], strips, per_line=len(_SHOWN)),
    )
    table = pages.Table(
        "Means over the cameras: median |depth - exact| (longest side about 2) and angle where both see the shape,"
        " share of pixels where only one does, queries a pixel. Interior error: rays from anywhere in the box that end"
        " elsewhere than the mesh says, by more than 1 % of its longest side.",
        ["shape", "depth", "normals, °", "visibility error, %", "interior error, %", "queries a pixel"],
        lines,
    )
    return pages.Section("Fits of several shapes", [figure, table, "Answers [DDF22] fig. `singobjfits`."])

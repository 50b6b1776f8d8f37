"""Fits of several shapes: depth, normals and mean curvature from several cameras. [DDF22] fig. `singobjfits`.

One query a pixel; derivatives are those of the same oriented points. Truth: rays cast against the mesh.
"""

from pathlib import Path

import numpy as np

from ddf.data.synthetic import showcase
from ddf.fields import framed_field
from ddf.fit import inspection
from ddf.geometry import raycast, rays
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.figures import drawing, figure_fields
from ddf_lab.report import pages

NAMES = ("rabbit", "armchair", "airliner", "nested")
CAMERAS = ((35.0, 25.0, 0.9), (160.0, 15.0, 0.9))
_ASKED = ("visibility", "depth", "normals", "mean_curvature")
_COLUMNS = ("depth", "exact depth", "normals", "exact normals", "mean curv.")


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """A line of pictures per camera, errors per shape."""
    strips, lines, inner = [], [], {True: [], False: []}
    fields = [(name, figure_fields.fitted(name, config, folder)) for name in NAMES]
    for name, network in fields:
        mesh = showcase.SHAPES[name]()
        patches = drawing.patches(mesh)
        for what, field in ((name, network), (f"{name}, patches", patches)):
            rows, (depth, angle, wrong, asked) = _views(name, field, raycast.Scene(mesh), config.picture_size)
            strips += rows if field is network else []  # pictures of the paper's kind
            scale = field.field_from_mesh.scale
            inside = inspection.wrong_inside(field, inspection.beside(field, mesh))
            inner[field is network].append(inside)
            errors = [f"{scale * depth:.5f}", f"{angle:.1f}", f"{100 * wrong:.1f}"]
            lines.append([what, *errors, f"{inside:.1f}", f"{asked:.2f}"])
    return pages.Section(
        "Fits of several shapes",
        [
            pages.Figure(
                "fits.webp",
                "Curvature: blue is convex, red is concave. Right: what is seen from outside. Interior error:"
                f" networks err on {min(inner[True]):.0f} to {max(inner[True]):.0f} % of rays, patches on"
                f" {min(inner[False]):.1f} to {max(inner[False]):.1f} %.",
                "Depth, normals and mean curvature of four shapes from two cameras",
                picture_strips.strip(_COLUMNS, strips, per_line=len(_COLUMNS)),
            ),
            pages.Table(
                "Means over the cameras: median |depth - exact| (longest side about 2) and angle where both see the"
                " shape, share of pixels where only one does, queries a pixel. Interior error: rays from anywhere in"
                " the box that end elsewhere than the mesh says, by more than 1 % of its longest side.",
                ["shape", "depth", "normals, °", "visibility error, %", "interior error, %", "queries a pixel"],
                lines,
            ),
            "Answers [DDF22] fig. `singobjfits`.",
        ],
    )


def _views(
    name: str, field: framed_field.FramedField, scene: raycast.Scene, side: int
) -> tuple[list[picture_strips.StripRow], np.ndarray]:
    """A line of pictures per camera; errors of `_pictures` and queries a pixel, means over the cameras."""
    strips, errors = [], []
    for camera in CAMERAS:
        images, evaluated = framed_field.render(field, camera, side, _ASKED)
        starts, directions = framed_field.camera_rays(field, camera, side)
        back = field.field_from_mesh.inverse()
        hits = raycast.cast(scene, rays.OrientedPoints(back.apply(starts), back.apply_directions(directions)))
        cells, found = _pictures(images, hits)
        errors.append([*found, evaluated / side**2])
        strips.append(picture_strips.StripRow(f"{name}, azimuth {camera[0]:g}°", ("one query a pixel",), cells))
    return strips, np.mean(errors, axis=0)


def _pictures(
    images: dict[str, np.ndarray], hits: rays.RayHits[np.ndarray]
) -> tuple[list[picture_strips.Picture], list[float]]:
    """Cells of one camera; median depth error and angle, and the share of pixels with the wrong visibility."""
    shape = images["visibility"].shape
    true, normals, visible = (getattr(hits, name) for name in ("depth", "normals", "visible"))
    depths = field_pictures.depth_pictures(images["depth"], true.reshape(shape))
    seen = visible.reshape(shape).astype(float)
    cells = [
        *depths,
        field_pictures.normals_picture(images["normals"], images["visibility"]),
        field_pictures.normals_picture(normals.reshape(*shape, 3), seen),
        field_pictures.signed_picture(images["mean_curvature"], images["visibility"]),
    ]
    found = np.isfinite(images["depth"]).ravel()
    both = found & visible
    cosine = (images["normals"].reshape(-1, 3)[both] * normals[both]).sum(axis=1)
    angle = np.median(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    off = np.median(np.abs(images["depth"].ravel()[both] - true[both]))
    return cells, [float(off), float(angle), float((found != visible).mean())]

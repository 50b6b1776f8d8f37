"""The six sample types of a rabbit. [DDF22] fig. `datatypes`."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float

from ddf.data.samples import sample_types
from ddf.data.synthetic import showcase
from ddf.fit import fit_folder, patch_fitting, shape_samples
from ddf.geometry import mesh_io, rays
from ddf.pictures import picture_strips, shaded
from ddf_lab.figures import drawing, figure_fields
from ddf_lab.report import pages

SHAPE, SHOWN, SIDE = "rabbit", 50, 256  # of each type; pixels of a cell
_CAMERA, _LOOK = (35.0, 20.0, 1.2), 0.14
_LEGEND = (
    "blue p, green v: sees the shape, where the thin line ends",
    "black p, red v: sees nothing",
)


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """A cell per type."""
    inside, _ = fit_folder.in_cube(showcase.SHAPES[SHAPE]())
    rabbit = _samples(inside)
    row = picture_strips.StripRow("sample types", _LEGEND, _pictures(inside, rabbit, SIDE))
    figure = pages.Figure(
        "samples.webp",
        f"First the mesh, then {SHOWN} samples of each type: p uniform (U), v towards a point of the surface (A), p on"
        " the box (B), p on the surface (S), v along the surface (T), and beside such rays (O).",
        "A rabbit and samples of the six types",
        picture_strips.strip([SHAPE, *rabbit], [row], side=SIDE),
    )
    title = "Oriented points that hit and miss: six sample types"
    return pages.Section(title, [figure, "Answers [DDF22] fig. `datatypes`."])


def _samples(mesh: mesh_io.Mesh) -> dict[str, dict[str, Float[np.ndarray, "n ..."]]]:
    """Of a mesh in [-1, 1]³, by type, in its frame."""
    samples = shape_samples.draw_samples(mesh, shape_samples.Drawing(), sample_types.each(4000), "figure")
    found, random, units = {}, np.random.default_rng(0), {"positions": samples.unit, "depth": samples.unit}
    for kind, arrays in samples.arrays.items():
        mixed = random.permutation(len(arrays["depth"]))  # stored by side of the surface or of the edge
        found[kind] = {name: own.astype(np.float64)[mixed] / units.get(name, 1.0) for name, own in arrays.items()}
    return found


def _pictures(
    mesh: mesh_io.Mesh, samples: Mapping[str, Mapping[str, Float[np.ndarray, "n ..."]]], size: int
) -> list[picture_strips.Picture]:
    """The shape, then its samples of each type, and the legend."""
    on_ground = shaded.stand(patch_fitting.patches(mesh))
    around = np.concatenate([part["positions"][:SHOWN] for part in samples.values()])
    plain = drawing.Drawing.around(on_ground, _CAMERA, around, size)
    cells = [plain.picture()]
    for part in samples.values():
        drawn = dataclasses.replace(plain, image=plain.image.copy())
        p, v, d, visible = (part[name][:SHOWN] for name in ("positions", "directions", "depth", "visible"))
        seen = visible > 0
        hits = rays.surface_points(p[seen], v[seen], d[seen])
        drawn.lines(p[seen], hits, drawing.SIGHT)
        drawn.looks(p, p + _LOOK * v, seen, 1, 2)
        cells.append(drawn.picture())
    return cells

"""Depth renderers are DDFs of their pixels: a small convolutional network, plain and with the losses of a DDF.

[DDF22] app. `neurren`. Truth: rays cast against the mesh.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float
from torch import Tensor

from ddf.data.synthetic import showcase
from ddf.fit import renderer_fit
from ddf.models import loop_config
from ddf.pictures import field_pictures, picture_strips
from ddf_lab.figures import figure_fields
from ddf_lab.report import pages

SHAPE = "rabbit"
HELD_OUT, SHOWN = 64, 3  # cameras that errors are over, and those of the picture
LOSSES = {"depth and visibility": (0.0, 0.0), "and those of a DDF": (0.5, 0.5)}  # weights of eikonal and gradient


def recipe(steps: int, weights: tuple[float, float]) -> renderer_fit.RendererConfig:
    """On one thread, with Muon for the kernels."""
    loop = loop_config.LoopConfig(5e-3, "cosine", 50, 1.0, 1, muon_kernels=0.02)
    return renderer_fit.RendererConfig(loop, steps, eikonal=weights[0], gradient=weights[1])


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Both trainings: pictures from cameras that neither has seen, and errors."""
    mesh, cells, rows = showcase.SHAPES[SHAPE](), [], []
    views = renderer_fit.CameraRange().draw(HELD_OUT, np.random.default_rng(1))
    true = renderer_fit.cast(mesh, views, recipe(1, (0.0, 0.0)).layout.image)
    for number, (name, weights) in enumerate(LOSSES.items()):
        settings, place = recipe(config.renderer_steps, weights), folder / f"renderer_{number}"
        found, residuals = renderer_fit.render(renderer_fit.fit(mesh, settings, place), views)
        cells.append(found)
        rows.append(_row(name, renderer_fit.errors(found, residuals, true)))
    columns = ["depth", "with DDF losses", "exact depth", "normals", "with DDF losses", "exact normals"]
    strips = [
        picture_strips.StripRow(
            f"held-out camera {index + 1}", ("normals by Property II",), _cells(index, *cells, true)
        )
        for index in range(SHOWN)
    ]
    header = ["trained with losses of", "depth", "normals, °", "wrong visibility, %", "Property I", "Property III"]
    size = true.depth.shape[-1]
    return pages.Section(
        "Depth renderers are DDFs",
        [
            pages.Figure(
                "renderers.webp",
                f"A network from a camera to all {size} x {size} pixels at once. Its normals are its derivative in the"
                " camera's position.",
                "Depth and normals of two depth renderers from three cameras, beside the exact ones",
                picture_strips.strip(columns, strips, per_line=len(columns)),
            ),
            pages.Table(
                f"Medians over the pixels of {HELD_OUT} held-out cameras where both see the {SHAPE} (longest side 2):"
                " |depth - exact|, angle of normals, and residuals: |δ_p · v + 1| of Property I, with δ_p the"
                " derivative in the camera's position, and ‖δ_ω - d (v × δ_p)‖ of Property III, with δ_ω that in its"
                " turn. Wrong visibility: share of pixels where only one sees it."
                f" {config.renderer_steps:,} steps each, on one thread.",
                header,
                rows,
            ),
            "Five convolutions with sine activations; the camera enters as rays (p, v) of its pixels at three"
            " resolutions, so a pixel depends on its neighbours' rays. The losses of a DDF are the directed eikonal and"
            " gradient consistency, asked of two of the eight images of a step.",
            "Answers [DDF22] app. `neurren`.",
        ],
    )


def _row(name: str, found: dict[str, float]) -> list[str]:
    values = [f"{found['depth']:.4f}", f"{found['normals_deg']:.1f}", f"{100 * found['wrong']:.1f}"]
    return [name, *values, f"{found['eikonal']:.3f}", f"{found['gradient']:.3f}"]


def _cells(index: int, *images: renderer_fit.Images) -> list[picture_strips.Picture]:
    """Depths on one scale, then normals."""
    depths = [np.where(_of(each.visible, index), _of(each.depth, index), np.inf) for each in images]
    normals = [field_pictures.normals_picture(_of(each.normals, index), _of(each.visible, index)) for each in images]
    return [*field_pictures.depth_pictures(*depths), *normals]


def _of(values: Tensor, index: int) -> Float[np.ndarray, "h w ..."]:
    return values[index].double().numpy()

"""What the consistency losses buy: fits of one shape, alike but for one loss.

[DDF22] app. `viewconsis` and Property III.
"""

import dataclasses
from pathlib import Path

from ddf.core import storage
from ddf.data.samples import sample_types
from ddf.data.synthetic import showcase
from ddf.report import pages
from ddf.report.paper_figures import figure_fields
from ddf.shape import field_diagnostics, fit_settings, fitting, shape_field

SHAPE = "rabbit"
_KINDS = ("U", "S")
FITS = {
    "none": fit_settings.ConsistencyWeights(),
    "view, 0.3": fit_settings.ConsistencyWeights(view=0.3),
    "gradient, 0.01": fit_settings.ConsistencyWeights(gradient=0.01),
}
RAYS, SAMPLES, HELD_OUT = 10_000, 20_000, 5_000  # random rays of the residuals; samples a type


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """One table."""
    mesh, rows = showcase.SHAPES[SHAPE](), []
    for number, (name, weights) in enumerate(FITS.items()):
        settings = dataclasses.replace(
            figure_fields.recipe(SHAPE, config),
            steps=config.consistency_steps,
            samples=sample_types.Counts(**dict.fromkeys(dict(fit_settings.DEFAULT.samples.items()), SAMPLES)),
            held_out=sample_types.Counts(**dict.fromkeys(dict(fit_settings.DEFAULT.samples.items()), HELD_OUT)),
            consistency=weights,
        )
        place = folder / f"consistency_{number}"
        figure_fields.keep(mesh, settings, place)
        rows.append(_row(name, place))
    header = ["loss, its weight", *(f"d, {kind}" for kind in _KINDS), "normals, °", "view d, 95 %", "1 - ξ, 95 %"]
    header += ["Property III"]
    return pages.Section(
        "Consistency losses",
        [
            pages.Table(
                f"Fits of the {SHAPE}, {config.consistency_steps:,} steps and {SAMPLES:,} samples a type each."
                " Mean depth errors per held-out type and"
                f" median angle of normals; residuals over {RAYS:,} random rays: depth beyond a point that was seen,"
                " and 1 - visibility of it, 95 %; median of the gradient consistency.",
                [("", len(header), False)],
                header,
                rows,
            ),
            "Answers [DDF22] app. `viewconsis` and Property III. Both losses are off by default (`fit.consistency`).",
        ],
    )


def _row(name: str, place: Path) -> list[str]:
    """Errors, residuals and time of one fit."""
    fit = storage.read_json(place / fitting.METRICS)
    found = field_diagnostics.measure(shape_field.load(place), RAYS)
    held_out = fit["held_out"]
    return [
        name,
        *(f"{held_out['depth_l1'][kind]:.4f}" for kind in _KINDS),
        f"{held_out['normal_angle_deg_median']:.1f}",
        f"{found['view_depth']['p95']:.3f}",
        f"{found['view_visibility']['p95']:.3f}",
        f"{found['gradient_consistency']['median']:.3f}",
    ]

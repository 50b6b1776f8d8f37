"""What the consistency losses buy: a fitted field trained further, alike but for one loss.

[DDF22] app. `viewconsis` and Property III.
"""

import dataclasses
from pathlib import Path
from typing import Any

from ddf.core import storage
from ddf.data.samples import sample_types
from ddf.data.synthetic import showcase
from ddf.fields import shape_field
from ddf.fit import field_diagnostics, fit_settings, fitting
from ddf_lab.figures import figure_fields
from ddf_lab.report import pages

SHAPE = "rabbit"
FITS = {
    "none": fit_settings.ConsistencyWeights(),
    "view, 5": fit_settings.ConsistencyWeights(view=5.0),
    "gradient, 0.5": fit_settings.ConsistencyWeights(gradient=0.5),
}
RAYS, SAMPLES, HELD_OUT = 10_000, 60_000, 5_000  # random rays of the residuals; samples a type
_LABEL = "loss, its weight"
_RESIDUALS = ("1 - ξ, 95 %", "view d, 95 %", "Property III", "visibility of U", "seconds")


def section(config: figure_fields.FiguresConfig, folder: Path) -> pages.Section:
    """Errors by sample type, then residuals."""
    mesh, fitted = showcase.SHAPES[SHAPE](), figure_fields.fitted(SHAPE, config, folder)
    errors, residuals = [], []
    for number, (name, weights) in enumerate(FITS.items()):
        settings = dataclasses.replace(further(config), consistency=weights)
        place = folder / f"consistency_{number}"
        fitting.fit(mesh, settings, place, begin=fitted, force=True)
        fit, field = storage.read_json(place / fitting.METRICS), shape_field.load(place)
        errors.append(error_line(name, fit["held_out"]))
        residuals.append(residual_line(name, fit, field_diagnostics.measure(field, RAYS)))
    return pages.Section(
        "Consistency losses",
        [
            _table(
                f"The fitted {SHAPE}, trained {config.consistency_steps:,} steps further with one loss more or none."
                " Mean depth errors by held-out type and median angle of normals.",
                [_LABEL, *(f"d, {kind}" for kind in sample_types.KINDS), "normals, °"],
                errors,
            ),
            _table(
                f"The same fields. Residuals over {RAYS:,} random rays: 1 - visibility of a point that was seen, depth"
                " beyond it, median of the gradient consistency; cross-entropy of held-out visibility; time of the"
                " steps.",
                [_LABEL, *_RESIDUALS],
                residuals,
            ),
            "Answers [DDF22] app. `viewconsis` and Property III. Both losses are off otherwise.",
        ],
    )


def further(config: figure_fields.FiguresConfig) -> fit_settings.FitConfig:
    """How a fitted field is trained on: small steps of Adam alone, which leave what it has learned."""
    base = figure_fields.recipe(SHAPE, config)
    return dataclasses.replace(
        base,
        steps=config.consistency_steps,
        samples=sample_types.each(SAMPLES),
        held_out=HELD_OUT,
        loop=dataclasses.replace(base.loop, learning_rate=5e-4, muon=None),
    )


def error_line(name: str, held_out: dict[str, Any]) -> list[str]:
    """Of the first table, from the held-out errors of a fit."""
    depths = [f"{held_out['depth_l1'][kind]:.4f}" for kind in sample_types.KINDS]
    return [name, *depths, f"{held_out['normal_angle_deg_median']:.2f}"]


def residual_line(name: str, fit: dict[str, Any], found: dict[str, dict[str, float]]) -> list[str]:
    """Of the second, from fit.json and what `field_diagnostics.measure` found."""
    values = found["view_visibility"]["p95"], found["view_depth"]["p95"], found["gradient_consistency"]["median"]
    entropy = fit["held_out"]["visibility_bce"]["U"]
    seconds = fit["seconds"] - fit["sampling_seconds"]
    return [name, *(f"{value:.4f}" for value in values), f"{entropy:.3f}", f"{seconds:.0f}"]


def _table(caption: str, header: list[str], rows: list[list[str]]) -> pages.Table:
    return pages.Table(caption, header, rows)

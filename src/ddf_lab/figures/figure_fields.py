"""The fields that the figures are of: those that come with the package, and a few short fits, kept as artefacts."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ddf.core import checks, shipped_models
from ddf.data.samples import sample_types
from ddf.data.synthetic import showcase
from ddf.fit import fit_settings, fitting, shape_field
from ddf.fit.shape_field import ShapeField
from ddf.geometry.mesh_io import Mesh

STAND = (0.5, (0.0, -0.74, 0.0))  # scale and place of the rabbit in the room: its feet are on the floor
SHAPES: dict[str, Callable[[], Mesh]] = {
    "room": showcase.room,
    "two_spheres": showcase.two_spheres,
    "furnished": lambda: showcase.furnished(*STAND),
}
WIDER = ("furnished",)  # [DDF22] app. `noncompfiteg`: twice the width, twice the samples


@dataclass(frozen=True)
class FiguresConfig:
    """Section `figures`: how long the fits of the figures take.

    steps: of a part. whole_steps: of the one field of the furnished room, whose step costs four times as much.
    candidate_steps: of g_v; paper_candidates: with the paper's points a step and rate. consistency_steps: of each fit
    of the table of consistency losses. renderer_steps: of each depth renderer. picture_size: pixels.
    """

    steps: int
    whole_steps: int
    candidate_steps: int
    consistency_steps: int
    renderer_steps: int
    picture_size: int
    paper_candidates: bool = False

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            if field.name != "paper_candidates" and getattr(self, field.name) < 1:
                raise checks.InputError(f"figures.{field.name} must be >= 1; got {getattr(self, field.name)}")


def recipe(name: str, config: FiguresConfig) -> fit_settings.FitConfig:
    """That of `ddf fit`, for a number of steps, on one thread."""
    base = fit_settings.DEFAULT
    found = dataclasses.replace(base, steps=config.steps, minutes=None, loop=dataclasses.replace(base.loop, threads=1))
    if name not in WIDER:
        return found
    wider = dataclasses.replace(base.field, hidden=tuple(2 * width for width in base.field.hidden))
    more = sample_types.Counts(**{kind: 2 * count for kind, count in base.samples.items()})
    return dataclasses.replace(found, field=wider, samples=more, steps=config.whole_steps)


def fitted(name: str, config: FiguresConfig, folder: Path) -> ShapeField:
    """The field of one of `SHAPES`, fitted in `folder`/name, or of a name of `ddf models`."""
    if name not in SHAPES:
        return shape_field.load(shipped_models.place(name))
    fitting.fit(SHAPES[name](), recipe(name, config), folder / name, force=True)
    return shape_field.load(folder / name)

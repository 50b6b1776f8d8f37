"""The fields that the figures are of: those that come with the package, and a few short fits, kept as artefacts."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ddf.core import schema, shipped_models
from ddf.core.schema import fixed, setting
from ddf.data.samples import sample_types
from ddf.data.synthetic import showcase
from ddf.fields import shape_field
from ddf.fields.shape_field import ShapeField
from ddf.fit import fit_settings, fitting
from ddf.geometry.mesh_io import Mesh

STAND = (0.5, (0.0, -0.74, 0.0))  # scale and place of the rabbit in the room: its feet are on the floor
SHAPES: dict[str, Callable[[], Mesh]] = {
    "room": showcase.room,
    "two_spheres": showcase.two_spheres,
    "furnished": lambda: showcase.furnished(*STAND),
}
WIDER = ("furnished",)  # [DDF22] app. `noncompfiteg`: twice the width, twice the samples


@dataclass(frozen=True)
class FiguresConfig(schema.Checked):
    """Section `figures`: how long the fits of the figures take.

    steps: of a part. whole_steps: of the one field of the furnished room, twice as wide, whose step costs four times as
    much. candidate_steps: of g_v, where it is not trained as the paper does. picture_size: pixels.
    """

    paper_candidates: bool = setting(False, "whether g_v is trained as the paper does, which takes more than an hour")
    steps: int = fixed(1500, least=1)
    whole_steps: int = fixed(400, least=1)
    candidate_steps: int = fixed(300, least=1)
    picture_size: int = fixed(256, least=1)


def recipe(name: str, config: FiguresConfig) -> fit_settings.FitConfig:
    """That of `ddf fit`, for a number of steps, on one thread."""
    base = fit_settings.FitConfig()
    found = dataclasses.replace(base, steps=config.steps, minutes=None, loop=dataclasses.replace(base.loop, threads=1))
    if name not in WIDER:
        return found
    wider = dataclasses.replace(base.field, hidden=tuple(2 * width for width in base.field.hidden))
    more = sample_types.scaled(base.samples, 2)
    return dataclasses.replace(found, field=wider, samples=more, steps=config.whole_steps)


def fitted(name: str, config: FiguresConfig, folder: Path) -> ShapeField:
    """The field of one of `SHAPES`, fitted in `folder`/name, or of a name of `ddf models`."""
    if name not in SHAPES:
        return shape_field.load(shipped_models.place(name))
    fitting.fit(SHAPES[name](), recipe(name, config), folder / name, force=True)
    return shape_field.load(folder / name)

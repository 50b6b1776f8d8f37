"""The fields that the figures are of: those that come with the package, and a few short fits, kept as artefacts."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ddf.core import schema, shipped_models
from ddf.core.schema import fixed, setting
from ddf.data.synthetic import showcase
from ddf.fields import shape_field
from ddf.fields.shape_field import ShapeField
from ddf.fit import fit_settings, fitting
from ddf.geometry.mesh_io import Mesh

SHAPES: dict[str, Callable[[], Mesh]] = {"room": showcase.room, "two_spheres": showcase.two_spheres}  # fitted here


@dataclass(frozen=True)
class FiguresConfig(schema.Checked):
    """Section `figures`: how long the fits of the figures take.

    candidate_steps: of g_v, where it is not trained as the paper does. picture_size: pixels.
    """

    paper_candidates: bool = setting(False, "whether g_v is trained as the paper does, which takes more than an hour")
    steps: int = fixed(1500, least=1)
    candidate_steps: int = fixed(300, least=1)
    picture_size: int = fixed(256, least=1)


def fitted(name: str, config: FiguresConfig, folder: Path) -> ShapeField:
    """The network of one of `SHAPES`, fitted in `folder`/name on one thread, or that which comes with the package."""
    if name not in SHAPES:
        return shape_field.load(shipped_models.place(f"{name}-network"))
    base = fit_settings.FitConfig()
    loop = dataclasses.replace(base.loop, threads=1)
    recipe = dataclasses.replace(base, steps=config.steps, minutes=None, loop=loop)
    fitting.fit(SHAPES[name](), recipe, folder / name, force=True)
    return shape_field.load(folder / name)

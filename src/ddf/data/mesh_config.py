"""Settings of the stage `meshes`, apart from the code that needs geometry packages."""

from dataclasses import dataclass
from typing import Literal

from ddf.core import schema
from ddf.core.schema import fixed, setting

# Of a prepared mesh, as `mesh_preparation.measure` gives them.
LOSSES = ("hausdorff", "mean_distance", "hausdorff_seen", "mean_distance_seen", "hausdorff_hidden", "lost")


@dataclass(frozen=True)
class MeshesConfig(schema.Checked):
    """Section `meshes`: how raw meshes become training meshes. The others than `shapes` have images alone.

    holes: whether openings are filled before anything else.
    seed: of the points that the loss is measured at, and of the choice of `shapes`.
    """

    faces: int = setting(10_000, "triangles at most, after decimation", "app. si3dr", least=4)
    alpha: float = setting(
        0.02, "share of the diagonal: narrower openings are closed by the wrap", least=1e-3, most=0.5
    )
    offset: float = fixed(0.001, least=1e-5)
    wrap: Literal["auto", "always", "never"] = setting(
        "auto",
        "auto: CGAL's alpha wrap of what is not one closed surface (the paper: Kaolin's form); never: all stays",
        "app. si3dr",
    )
    holes: bool = fixed(False)
    measure_points: int = setting(10_000, "points a side for the figures of what was lost", least=1)
    seed: int = fixed(0, least=0)
    shapes: int | None = setting(
        None, "of a category, chosen at random, that are prepared and sampled; null: all", "app. si3dr", least=1
    )

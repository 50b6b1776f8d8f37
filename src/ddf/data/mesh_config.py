"""Settings of the stage `meshes`, apart from the code that needs geometry packages."""

from dataclasses import dataclass

from ddf.core import checks

# Of a prepared mesh, as `mesh_preparation.measure` gives them.
LOSSES = ("hausdorff", "mean_distance", "hausdorff_seen", "mean_distance_seen", "hausdorff_hidden", "lost")


@dataclass(frozen=True)
class MeshesConfig:
    """How raw meshes become training meshes.

    faces: upper bound on the triangles of a result.
    alpha: the wrap enters no opening narrower than this.
    offset: distance of the wrap from the raw surface.
    wrap: "auto" keeps a closed mesh that nowhere passes through itself; "always" wraps everything;
      "never" keeps every mesh as it is, open sheets and hidden inner parts included.
    holes: openings up to this width are filled before anything else; 0 fills none.
    measure_points: points a side for the loss figures.
    shard_size: shapes in one file.
    seed: of the points that the loss is measured at, and of the choice of `shapes`.
    shapes: of a category, chosen at random, that are prepared and sampled; null: all. The others have images alone.
    """

    faces: int = 10_000
    alpha: float = 0.02
    offset: float = 0.001
    wrap: str = "auto"
    holes: float = 0.0
    measure_points: int = 10_000
    shard_size: int = 16
    seed: int = 0
    shapes: int | None = None

    def __post_init__(self) -> None:
        if self.faces < 4:
            raise checks.InputError(f"meshes.faces must be >= 4; got {self.faces}")
        if not 1e-3 <= self.alpha <= 0.5:
            raise checks.InputError(f"meshes.alpha must be in [0.001, 0.5] of the diagonal; got {self.alpha}")
        if not 1e-5 <= self.offset <= self.alpha:
            raise checks.InputError(f"meshes.offset must be in [0.00001, alpha]; got {self.offset}")
        if self.wrap not in ("auto", "always", "never"):
            raise checks.InputError(f"meshes.wrap must be auto, always or never; got {self.wrap!r}")
        if not 0.0 <= self.holes <= 1.0:
            raise checks.InputError(f"meshes.holes must be in [0, 1] of the diagonal; got {self.holes}")
        if self.measure_points < 1:
            raise checks.InputError(f"meshes.measure_points must be >= 1; got {self.measure_points}")
        if self.shapes is not None and self.shapes < 1:
            raise checks.InputError(f"meshes.shapes must be >= 1, or null for all; got {self.shapes}")
        if self.shard_size < 1:
            raise checks.InputError(f"meshes.shard_size must be >= 1; got {self.shard_size}")

"""Settings of a fit to one shape: section `fit` of a file. Its defaults are what `ddf fit` does without one."""

from dataclasses import dataclass
from typing import Literal

from ddf.core import checks, schema
from ddf.core.schema import fixed, setting
from ddf.data.samples import sample_types
from ddf.fields import losses, pddf
from ddf.fit import shape_samples
from ddf.models import loop_config


@dataclass(frozen=True)
class FitConfig(schema.Checked):
    """Section `fit`: a field, and how it is fitted to one shape.

    minutes: include sampling but not the held-out errors.
    batch: those with + may be left out (`sample_types.STORED_VALUES`).
    epsilon_o: offset of O samples, field units.
    margin: the longest side of the shape is 2 (1 - margin), in the frame of samples and field. Lengths here and in
      results are those of a shape whose longest side is 2.
    start: what the depths begin as: `flat`, nearly their mean over the training samples (`start_flat`), or `random`,
      about `pddf.INITIAL_DEPTH`.
    """

    mesh: str | None = setting(None, "file that the stage fit_shape fits; null: a procedural chair")
    field: pddf.PDDFConfig = setting(
        pddf.PDDFConfig((128,) * 5, 2.0, 1.0, "softplus", 100.0, 0.5), "a small, fast field"
    )
    steps: int | None = setting(None, "the reproducible budget; decides where both are given", least=1)
    minutes: float | None = setting(2.0, "of sampling and training, on two cores", above=0)
    samples: dict[str, int] = setting(
        {"U": 250_000, "A": 250_000, "B": 125_000, "S": 125_000, "T": 125_000, "O": 125_000},
        "drawn of each type, for training",
        "app. singlefits",
    )
    held_out: int = setting(shape_samples.HELD_OUT, "drawn of each type, for the errors", least=1)
    batch: dict[str, int] = setting(
        {"U": 120, "A": 140, "B": 60, "S": 60, "T": 60, "O": 200, "E": 50}
        | {"U+": 350, "A+": 500, "B+": 300, "S+": 550, "T+": 450},
        "oriented points of a step; E without truth; with +: depth and visibility alone, at less than half the cost",
    )
    weights: losses.LossWeights = setting(
        losses.LossWeights(
            depth_of="gated",
            depth_huber=0.02,
            visibility=1.0,
            normals=1.0,
            weight_variance=0.1,
            eikonal_depth=0.5,
            eikonal_visibility=0.01,
            transition=0.05,
            visibility_variance=0.0,
        ),
        "γ of the loss",
    )
    epsilon_o: float = fixed(shape_samples.Drawing.epsilon_o, above=0, below=1)
    margin: float = setting(
        shape_samples.Drawing.margin,
        "field units between the shape and its box, in whose sides rays would begin on faces",
        least=0,
        below=1,
    )
    start: Literal["flat", "random"] = setting("flat", "of the depths: their mean over the samples, or random heads")
    loop: loop_config.LoopConfig = setting(
        loop_config.LoopConfig(5e-3, "cosine", 50, 1.0, 2, muon=0.03), "how it is optimised"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "samples", sample_types.stored("samples", self.samples))
        sample_types.check_counts("batch", self.batch)
        if self.steps is None and self.minutes is None:
            raise checks.InputError("steps or minutes must be given; both are null")

    @property
    def drawing(self) -> shape_samples.Drawing:
        """How samples are drawn."""
        return shape_samples.Drawing(self.margin, self.epsilon_o, self.loop.seed)

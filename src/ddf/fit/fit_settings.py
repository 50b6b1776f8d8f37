"""Settings of a fit to one shape: section `fit` of its file, and what `ddf fit` does without one."""

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

from ddf.core import checks
from ddf.data import sampling
from ddf.data.samples import sample_types
from ddf.fields import losses, pddf
from ddf.training import training_loop


def _check_budget(where: str, steps: int | None, minutes: float | None) -> None:
    """Raise unless a fit has at least one budget, and a possible one."""
    if steps is None and minutes is None:
        raise checks.InputError(f"{where}.steps or {where}.minutes must be given; both are null")
    if steps is not None and steps < 1:
        raise checks.InputError(f"{where}.steps must be >= 1 or null; got {steps}")
    if minutes is not None and not 0 < minutes < float("inf"):
        raise checks.InputError(f"{where}.minutes must be > 0 or null; got {minutes}")


@dataclass(frozen=True)
class PageConfig:
    """Section `fit.page`: pictures and diagnostics of the fitted field.

    picture_size: pixels a side. up: axis of the mesh that points up. rays: random rays that the diagnostics are over.
    """

    picture_size: int
    up: Literal["y", "z"]
    rays: int

    def __post_init__(self) -> None:
        if not 8 <= self.picture_size <= 1024:
            raise checks.InputError(f"fit.page.picture_size must be in 8..1024; got {self.picture_size}")
        if self.rays < 1:
            raise checks.InputError(f"fit.page.rays must be >= 1; got {self.rays}")


@dataclass(frozen=True)
class AblationConfig:
    """Section `fit.ablation`: one fit without each sample type and one with all (`sample_ablation`).

    samples: drawn for each fit, all types together. held_out: per type, for the errors.
    steps, minutes: the budget of each fit, as in `FitConfig`; minutes set the steps of the fit with all types, and the
      other fits take as many.
    """

    samples: int
    held_out: int
    steps: int | None
    minutes: float | None

    def __post_init__(self) -> None:
        if self.samples < len(sample_types.ORDER) - 1:
            raise checks.InputError(
                f"fit.ablation.samples must be >= {len(sample_types.ORDER) - 1}; got {self.samples}"
            )
        if self.held_out < 1:
            raise checks.InputError(f"fit.ablation.held_out must be >= 1; got {self.held_out}")
        _check_budget("fit.ablation", self.steps, self.minutes)


@dataclass(frozen=True)
class ConsistencyWeights:
    """Section `fit.consistency`: γ of what only a true DDF satisfies (`fields.consistency`); none in the paper.

    view: of the inequality ξ(p_2, v_2) = 1, d(p_2, v_2) <= t for points q_1 of the surface that U samples see, looked
    at from the position of another U sample. gradient: of Property III, on U samples. 0 costs nothing.
    """

    view: float = 0.0
    gradient: float = 0.0

    def __post_init__(self) -> None:
        for name in ("view", "gradient"):
            if not 0 <= getattr(self, name) < float("inf"):
                raise checks.InputError(f"fit.consistency.{name} must be >= 0 and finite; got {getattr(self, name)}")


_PAGE, _ABLATION = PageConfig(168, "y", 20_000), AblationConfig(500_000, 25_000, None, 0.75)


@dataclass(frozen=True)
class FitConfig:
    """Section `fit`: a field, and how it is fitted to one shape.

    mesh: the file that the stage `fit_shape` fits, null for a procedural chair; `ddf fit` names its own.
    steps, minutes: the budget; steps decides where both are given, minutes include sampling but not the held-out
      errors.
    samples, held_out: drawn per type, for training and for the errors.
    batch: oriented points per type in a step, E the extra uniform ones; with + those of a type that are supervised by
      depth and visibility alone, for less than half the cost (`sample_types.STORED_VALUES`, may be left out).
    epsilon_o: offset of O samples, field units.
    box: the shape's own box (a cube, where that is too thin) or the cube [-1, 1]^3.
    margin: room between the shape and the sides of the box, field units: the longest side of the shape is
      2 (1 - margin), in the frame of samples and field. With 0, the paper's way, rays from outside begin on faces that
      lie in a side of the box, where the field is of two minds. Lengths in the config and in results are those of a
      shape whose longest side is 2.
    start: what the depths begin as: `flat`, nearly their mean over the training samples (`start_flat`), or `random`,
      the paper's, about `pddf.INITIAL_DEPTH`.
    page, ablation: read by the stages `fit_shape` and `ablate_samples` alone; no part of the fit itself, and not needed
      for `ddf fit`.
    """

    mesh: str | None
    field: pddf.PDDFConfig
    steps: int | None
    minutes: float | None
    samples: sample_types.Counts
    held_out: sample_types.Counts
    batch: dict[str, int]
    weights: losses.LossWeights
    epsilon_o: float
    box: Literal["tight", "cube"]
    margin: float
    start: Literal["flat", "random"]
    loop: training_loop.LoopConfig
    consistency: ConsistencyWeights = ConsistencyWeights()
    page: PageConfig = _PAGE
    ablation: AblationConfig = _ABLATION

    def __post_init__(self) -> None:
        sample_types.check_counts("fit.batch", self.batch)
        _check_budget("fit", self.steps, self.minutes)
        self.draw(self.box, self.samples, 0)

    def draw(self, box: Literal["tight", "cube"], counts: sample_types.Counts, seed: int) -> sampling.SamplesConfig:
        """What `sampling.extract` draws."""
        epsilon_o = self.epsilon_o * (1 - self.margin)
        return sampling.SamplesConfig(counts, epsilon_o, "fixed", box, self.margin, seed=seed)

    def recipe(self) -> dict[str, Any]:
        """What decides the fitted field: everything but `page` and `ablation`."""
        own = [item.name for item in dataclasses.fields(self) if item.name not in ("page", "ablation")]
        return {name: getattr(self, name) for name in own}


DEFAULT = FitConfig(
    mesh=None,
    field=pddf.PDDFConfig((128, 128, 128, 128, 128), 2.0, 1.0, "softplus", 100.0, 0.5),
    steps=None,
    minutes=2.0,
    samples=sample_types.Counts(U=250_000, A=250_000, B=125_000, S=125_000, T=125_000, O=125_000),
    held_out=sample_types.Counts(U=10_000, A=10_000, B=10_000, S=10_000, T=10_000, O=10_000),
    batch={"U": 120, "A": 140, "B": 60, "S": 60, "T": 60, "O": 200, "E": 50}
    | {"U+": 350, "A+": 500, "B+": 300, "S+": 550, "T+": 450},
    weights=losses.LossWeights(5.0, "gated", 0.02, 1.0, 1.0, 0.1, 0.5, 0.01, 0.05, 0.0, 1.0),
    epsilon_o=0.05,
    box="tight",
    margin=0.02,
    start="flat",
    loop=training_loop.LoopConfig(5e-3, "cosine", 50, 1.0, 2, 0, 50, 30.0, muon=0.03),
)

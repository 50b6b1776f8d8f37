"""Which differences between methods may be called one: standard errors, Student's t and Holm's correction.

Images of one shape are taken together, for they are no independent cases. With N shapes and S trainings of each method
the standard error of the mean difference is the root of s_N² / N + s_1² / S + s_2² / S:

- s_N², over shapes, of the difference averaged over trainings: both methods saw the same shapes, which are paired.
- s_1² and s_2², over trainings, of each method's mean over shapes: trainings of two models have nothing in common,
  whatever their seeds.

What shape and training do together is in all three, so the error is never too small. Of one training each the first
term alone is left: then a claim is of these trainings and no others.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy import special

from ddf.core import checks
from ddf.metrics import cloud_scores

LEVEL = 0.05  # chance of any wrong claim in a table
SCORES, POINTS = ("chamfer_l2_sq_x1000", "f_score_tau_x100"), "-L"  # claims are of these alone, fixed before any run
DIGITS = "%.5g"  # of the scores per image that git keeps
IMAGE = ["category", "method", "column", "id", "view"]

Key = TypeVar("Key")
Head = tuple[str, str]  # method, column
Scored = dict[Any, pd.DataFrame]  # rows of a category, method and column
Comparison = tuple[str, Head, Head, str]  # category, both heads, metric of the long table


@dataclass(frozen=True)
class Difference:
    """Mean of first - second, over `shapes` shapes and `trainings` trainings of what has more.

    error: standard error; NaN of a single shape. freedom: its degrees, by Welch and Satterthwaite.
    """

    mean: float
    error: float
    freedom: float
    shapes: int
    trainings: int

    @property
    def chance(self) -> float:
        """Of a mean so far from 0 where there is no difference: Student's t, two-sided; 1 of a single shape."""
        if not self.error > 0:
            return float(self.mean == 0 or math.isnan(self.error))
        return float(2 * special.stdtr(self.freedom, -abs(self.mean) / self.error))

    @property
    def half_interval(self) -> float:
        """Half the width of the interval about the mean that holds the difference with a chance of 95 %."""
        return float(special.stdtrit(self.freedom, 1 - LEVEL / 2) * self.error)


def difference(first: Float[np.ndarray, "s n"], second: Float[np.ndarray, "r n"]) -> Difference:
    """How scores differ from others, those of a training in a row, of a shape in a column.

    What no training changes has one row.
    """
    shapes = first.shape[1]
    parts = [((first.mean(axis=0) - second.mean(axis=0)).var(ddof=1) / shapes if shapes > 1 else math.nan, shapes)]
    parts += [(own.mean(axis=1).var(ddof=1) / len(own), len(own)) for own in (first, second) if len(own) > 1]
    variance, spread = sum(own for own, _ in parts), sum(own**2 / max(count - 1, 1) for own, count in parts)
    freedom = variance**2 / spread if spread else 1.0
    mean = float(first.mean() - second.mean())
    return Difference(mean, math.sqrt(variance), float(freedom), shapes, max(len(first), len(second)))


def holm(chances: Mapping[Key, float]) -> set[Key]:
    """Of comparisons by their chances those that are claimed together, at most one table in 20 with a wrong one.

    The smallest chance is held against `LEVEL` over the number of all, the next against that over one less, and so on
    until one is too large. Source: Holm 1979.
    """
    claimed = set[Key]()
    for key in sorted(chances, key=chances.__getitem__):
        if chances[key] > LEVEL / (len(chances) - len(claimed)):
            break
        claimed.add(key)
    return claimed


def may_claim(head: Head, metric: str) -> bool:
    """Whether tables claim anything of a column and metric; the others say much the same once more."""
    return metric in SCORES and head[1].endswith(POINTS)


def by_head(table: pd.DataFrame) -> Scored:
    """The rows of a per_image.csv by category, method and column, each by its image."""
    return dict(iter(table.set_index(["id", "view"]).groupby(["category", "method", "column"])))


def of_tables(
    tables: Sequence[Scored], category: str, first: Head, second: Head, metric: cloud_scores.Metric
) -> Difference | None:
    """How the scores of one method differ from those of another on the same images, in the units of tables.

    Args:
      tables: `by_head` of every training, in their order. A method that no training changes is in the first alone.
    Returns:
      None where either has no score. InputError: they were not scored on the same images.
    """
    own, other = (
        [table[category, *head][metric.score] for table in tables if (category, *head) in table]
        for head in (first, second)
    )
    if not own or not other:
        return None
    if set(own[0].index) != set(other[0].index):
        raise checks.InputError(f"{category}: {first} and {second} were not scored on the same images")
    means = [[each.groupby(level="id").mean() for each in scores] for scores in (own, other)]
    if any(not each.index.equals(means[0][0].index) for scores in means for each in scores):
        raise checks.InputError(f"{category}: the trainings were not scored on the same shapes")
    return difference(*(metric.factor * np.stack([each.to_numpy(np.float64) for each in scores]) for scores in means))


def better(tables: Sequence[pd.DataFrame], comparisons: Collection[Comparison]) -> set[Comparison]:
    """What is claimed of the comparisons of a table, all corrected together; the better head stands first."""
    chances, scored = dict[Comparison, float](), [by_head(table) for table in tables]
    for category, one, two, name in comparisons:
        metric = cloud_scores.METRICS[name]
        if found := of_tables(scored, category, one, two, metric):
            won = (found.mean < 0) == (metric.better == "min")
            key = category, *((one, two) if won else (two, one)), name
            chances[key] = found.chance
    return holm(chances)


def rows_of(table: pd.DataFrame, category: str, head: Head) -> pd.DataFrame:
    """Those of a per_image.csv that are of a category, and of a method and column."""
    return table[(table["category"] == category) & (table["method"] == head[0]) & (table["column"] == head[1])]


def as_text(tables: Sequence[pd.DataFrame]) -> str:
    """The scores per image that claims rest on, of all trainings, as git keeps them: CSV, five digits."""
    scores = [metric.score for metric in cloud_scores.METRICS.values()]
    parts = [table[[*IMAGE, *scores]].assign(training=number) for number, table in enumerate(tables)]
    return pd.concat(parts).to_csv(index=False, float_format=DIGITS, lineterminator="\n")

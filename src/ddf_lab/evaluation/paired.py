"""What a claim may rest on: means over trainings, and differences between two methods on the same images.

Images of one shape are taken together, for they are no independent cases. With N shapes and S trainings, the standard
error of the mean difference is the root of s_N² / N + s_S² / S: s_N² is the variance over shapes of the difference
averaged over trainings, s_S² the variance over trainings of the difference averaged over shapes (the terms of a crossed
design with both factors random; that of their interaction is in both, so the error is never too small).

Trainings (seeds) share data set, meshes, samples and test images; training and cloud drawing differ. Seed 0 is the run
that an experiment with one seed has.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import special

from ddf.core import checks, storage
from ddf.metrics import cloud_scores
from ddf_lab.evaluation import baselines, scoring
from ddf_lab.run import Run

CLAIMED = 0.95  # confidence with which a difference is called one: Student's two-sided t, 2.0 standard errors of many

_BY_IMAGE = (*scoring.FILES, *(method + scoring.THREE_VIEWS for method in scoring.FILES))
TRAINED = (*_BY_IMAGE, scoring.DDF_ONE_CYCLE, scoring.DDF_ON_MASK, baselines.RETRIEVAL)
COUNT = "count"  # written by make beside the tables of the further seeds
_KEYS = ["category", "method", "column", "metric"]


@dataclass(frozen=True)
class Difference:
    """Mean of first - second, in the units of tables, over `shapes` shapes and `trainings` trainings.

    error: standard error; NaN of a single shape. freedom: its degrees, by Welch and Satterthwaite.
    """

    mean: float
    error: float
    shapes: int
    trainings: int
    freedom: float

    @property
    def seen(self) -> bool:
        """Whether it exceeds what t asks of so many shapes and trainings; not of one shape, whose error is NaN."""
        return abs(self.mean) > special.stdtrit(self.freedom, (1 + CLAIMED) / 2) * self.error


def difference(
    tables: Sequence[pd.DataFrame],
    category: str,
    first: tuple[str, str],
    second: tuple[str, str],
    metric: cloud_scores.Metric,
) -> Difference | None:
    """How the scores of one method differ from those of another on the same images; None where either has no score.

    Args:
      tables: per_image.csv of every training, in their order. A method that no training changes is in the first alone.
      first, second: method and column.
    Raises:
      InputError: the trainings were not scored on the same images.
    """
    gaps = []
    for table in tables:
        own, other = (_scores(table, tables[0], category, head, metric) for head in (first, second))
        if own is None or other is None:
            return None
        if not own.index.equals(other.index):
            raise checks.InputError(f"{category}: {first} and {second} were not scored on the same images")
        gaps.append((own - other).groupby(level="id").mean())
    if any(not gap.index.equals(gaps[0].index) for gap in gaps):
        raise checks.InputError(f"{category}: the trainings were not scored on the same shapes")
    values = metric.factor * np.stack([gap.to_numpy() for gap in gaps])
    trainings, shapes = values.shape
    over_shapes = float(values.mean(axis=0).var(ddof=1)) / shapes if shapes > 1 else math.nan
    over_trainings = float(values.mean(axis=1).var(ddof=1)) / trainings if trainings > 1 else 0.0
    variance = over_shapes + over_trainings
    spread = over_shapes**2 / max(shapes - 1, 1) + over_trainings**2 / max(trainings - 1, 1)
    freedom = variance**2 / spread if spread else 1.0
    return Difference(float(values.mean()), math.sqrt(variance), shapes, trainings, freedom)


def rows_of(table: pd.DataFrame, category: str, head: tuple[str, str]) -> pd.DataFrame:
    """Those of a per_image.csv that are of a category, and of a method and column."""
    return table[(table["category"] == category) & (table["method"] == head[0]) & (table["column"] == head[1])]


def _scores(
    table: pd.DataFrame, fallback: pd.DataFrame, category: str, head: tuple[str, str], metric: cloud_scores.Metric
) -> pd.Series | None:
    """Of every image, by id and view, in their order."""
    for source in (table, fallback):
        rows = rows_of(source, category, head)
        if len(rows):
            return rows.set_index(["id", "view"])[metric.score].sort_index().astype(np.float64)
    return None


def better(found: Difference | None, metric: cloud_scores.Metric) -> int:
    """1 where the first method is better, -1 where the second is, 0 where no difference is seen."""
    if found is None or not found.seen:
        return 0
    return 1 if (found.mean < 0) == (metric.better == "min") else -1


def read_count(run: Run) -> int:
    """How many seeds the last call of make asked for; 1 where nothing was asked. InputError: it is no number >= 1."""
    path = run.folder("evaluate_seeds") / COUNT
    text = path.read_text(encoding="utf-8").strip() if path.exists() else "1"
    if not text.isdecimal() or int(text) < 1:
        raise checks.InputError(f"{path}: must hold the number of seeds, 1 or more; got {text!r}")
    return int(text)


def read_table(run: Run, seeds: int) -> pd.DataFrame:
    """The measured long table of the first `seeds` seeds, see `over_seeds`; InputError where they do not fit each
    other.
    """
    folders = [run.folder("evaluate", seed=seed) for seed in range(seeds)]
    return over_seeds([storage.load_table(folder / "si3dr.csv")[0] for folder in folders])


def over_seeds(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The first table with, in the rows of trained methods, mean and spread over all tables.

    There `value` is the mean over seeds of the means over images, `spread` the sample standard deviation over seeds and
    `seeds` their number. Other rows, which no training changes, stay as seed 0, the first, has them. One table alone is
    returned as it is.

    Raises:
      InputError: a seed has other trained rows, or another number of images, than seed 0.
    """
    first, values = tables[0], []
    if len(tables) == 1:
        return first
    trained = first["method"].isin(TRAINED)
    own = first[trained].set_index(_KEYS)
    for seed, table in enumerate(tables):
        rows = table[table["method"].isin(TRAINED)].set_index(_KEYS)
        odd = rows.index.symmetric_difference(own.index)
        if len(odd):
            raise checks.InputError(f"seed {seed} and seed 0 were not evaluated alike: {' '.join(map(str, odd[0]))}")
        rows = rows.loc[own.index]
        if (rows["images"] != own["images"]).any():
            raise checks.InputError(f"seed {seed} was evaluated on another number of images than seed 0")
        values.append(rows["value"].to_numpy(dtype=np.float64))
    merged = first.copy()
    merged.loc[trained, "value"] = np.mean(values, axis=0)
    merged.loc[trained, "spread"] = np.std(values, axis=0, ddof=1)
    merged.loc[trained, "seeds"] = len(tables)
    return merged

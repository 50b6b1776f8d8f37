"""The trainings of an experiment: how many there are, and means and spread over them.

Trainings (seeds) share data set, meshes, samples and test images; training and cloud drawing differ. Seed 0 is the run
that an experiment with one seed has.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from ddf.core import checks, storage
from ddf_lab.evaluation import baselines, scoring
from ddf_lab.run import Run

_BY_IMAGE = (*scoring.FILES, *(method + scoring.THREE_VIEWS for method in scoring.FILES))
TRAINED = (*_BY_IMAGE, scoring.DDF_ONE_CYCLE, scoring.DDF_ON_MASK, baselines.RETRIEVAL)
COUNT = "count"  # written by make beside the tables of the further seeds
_KEYS = ["category", "method", "column", "metric"]


def read_count(run: Run) -> int:
    """How many seeds the last call of make asked for; 1 where nothing was asked. InputError: it is no number >= 1."""
    path = run.folder("evaluate_seeds") / COUNT
    text = path.read_text(encoding="utf-8").strip() if path.exists() else "1"
    if not text.isdecimal() or int(text) < 1:
        raise checks.InputError(f"{path}: must hold the number of seeds, 1 or more; got {text!r}")
    return int(text)


def read_table(run: Run, seeds: int) -> pd.DataFrame:
    """The measured long table of the first `seeds` seeds, see `over_seeds`."""
    folders = [run.folder("evaluate", seed=seed) for seed in range(seeds)]
    return over_seeds([storage.load_table(folder / "si3dr.csv")[0] for folder in folders])


def over_seeds(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The first table with, in the rows of trained methods, mean and spread over all tables.

    There `value` is the mean over seeds of the means over images, `spread` the sample standard deviation over seeds and
    `seeds` their number. Other rows, which no training changes, stay as seed 0, the first, has them. One table alone is
    returned as it is. InputError where a seed has no such row, or one of other images.
    """
    first, trained = tables[0], tables[0]["method"].isin(TRAINED)
    if len(tables) == 1:
        return first
    own = first[trained].set_index(_KEYS)
    rows = [table.set_index(_KEYS).reindex(own.index) for table in tables]
    for seed, each in enumerate(rows):
        if len(odd := own.index[each["images"] != own["images"]]):
            raise checks.InputError(f"seed {seed} and seed 0 were not evaluated alike: {' '.join(map(str, odd[0]))}")
    values, merged = [each["value"].to_numpy(dtype=np.float64) for each in rows], first.copy()
    merged.loc[trained, "value"] = np.mean(values, axis=0)
    merged.loc[trained, "spread"] = np.std(values, axis=0, ddof=1)
    merged.loc[trained, "seeds"] = len(tables)
    return merged

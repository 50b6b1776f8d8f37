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
    """The measured long table of the first `seeds` seeds, see `over_seeds`.

    Raises:
      FileNotFoundError, InputError: a seed was not evaluated, or its table is damaged or does not fit the others.
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

"""Means and standard deviations over seeds, on tables whose numbers are known."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from ddf.core import checks, storage
from ddf_lab.evaluation import scoring, seeds
from ddf_lab.run import Run

RUN = Run(Path("configs/a.yaml"), {})


def _table(*rows):
    """Long table of (method, metric, value); every other field is the same."""
    full = [("chair", method, "Pi_g-L", metric, value, 32, 1, 0.5, scoring.MEASURED) for method, metric, value in rows]
    return pd.DataFrame(full, columns=list(scoring.TABLE_FIELDS))


FIRST = _table(("ddf", "a", 1.0), ("ceiling", "a", 9.0), ("pc_siren", "a", 4.0), ("retrieval", "a", 2.0))
SECOND = _table(("retrieval", "a", 2.0), ("pc_siren", "a", 6.0), ("ddf", "a", 2.0))  # other order, no ceiling
THIRD = _table(("ddf", "a", 6.0), ("pc_siren", "a", 5.0), ("retrieval", "a", 2.0))


def test_mean_and_sample_deviation_of_trained_rows():
    merged = seeds.over_seeds([FIRST, SECOND, THIRD]).set_index("method")
    assert merged.loc["ddf", "value"] == pytest.approx(3.0)
    assert merged.loc["ddf", "spread"] == pytest.approx(np.sqrt((4 + 1 + 9) / 2))
    assert merged.loc["pc_siren", ["value", "spread"]].tolist() == pytest.approx([5.0, 1.0])
    assert merged.loc["retrieval", ["value", "spread"]].tolist() == pytest.approx([2.0, 0.0])
    assert merged["seeds"].to_dict() == {"ddf": 3, "ceiling": 1, "pc_siren": 3, "retrieval": 3}
    assert (merged["images"] == 32).all()


def test_rows_that_no_training_changes_stay_and_so_does_the_order():
    merged = seeds.over_seeds([FIRST, SECOND])
    assert tuple(merged.columns) == scoring.TABLE_FIELDS
    assert merged["method"].tolist() == FIRST["method"].tolist()
    pd.testing.assert_frame_equal(merged.iloc[[1]], FIRST.iloc[[1]])
    assert FIRST["value"].tolist() == [1.0, 9.0, 4.0, 2.0]  # the input is left alone
    assert seeds.over_seeds([FIRST]) is FIRST


def test_seeds_that_were_not_evaluated_alike_are_refused():
    with pytest.raises(checks.InputError, match=r"seed 2 and seed 0 were not evaluated alike: chair pc_siren Pi_g-L a"):
        seeds.over_seeds([FIRST, SECOND, THIRD[THIRD["method"] != "pc_siren"]])
    with pytest.raises(checks.InputError, match="seed 1 and seed 0 were not evaluated alike"):
        seeds.over_seeds([FIRST, SECOND.assign(images=31)])


def test_the_number_of_seeds_is_what_make_wrote(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert seeds.read_count(RUN) == 1
    count = tmp_path / "artifacts/a/evaluate_seeds/count"
    storage.write_text(count, "3\n")
    assert seeds.read_count(RUN) == 3
    for wrong in ("", "0", "three"):
        count.write_text(wrong)
        with pytest.raises(checks.InputError, match="count: must hold the number of seeds"):
            seeds.read_count(RUN)

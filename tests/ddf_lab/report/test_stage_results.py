"""What the stages left behind is read, and named where it is missing."""

import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pandas as pd
import pytest
from _support import damage

from ddf.core import checks, storage
from ddf_lab.evaluation import baselines, scoring, seeds
from ddf_lab.report import pages, run_sections, stage_results


def test_further_seeds_are_evaluated_without_what_no_training_changes(seeded):
    artifacts = Path("artifacts") / "fake"
    first = storage.load_table(artifacts / "evaluate" / "si3dr.csv")[0]
    second = storage.load_table(artifacts / "evaluate_seeds" / "1" / "si3dr.csv")[0]
    assert set(second["method"]) == set(seeds.TRAINED) - {scoring.DDF_ON_MASK} < set(first["method"])
    keys = ["category", "method", "column", "metric"]
    both = [table[table["method"] == baselines.RETRIEVAL].set_index(keys)["value"] for table in (first, second)]
    pd.testing.assert_series_equal(*both)  # the fake's features are those of seed 0


def test_times_are_summed_over_categories(reported):
    _, run, _ = reported
    folder = Path("artifacts") / "fake" / "times"
    noted = {"train_ddf-chair": 100.0, "train_ddf-plane": 20.0, "train_ddf-primitives": 3.0, "dataset": 7.0}
    for name, seconds in {**noted, "train_pcsiren-chair": 5.0}.items():  # the last of one category alone
        storage.write_json(folder / f"{name}.json", {"seconds": seconds})
    results = stage_results.read_results(run)
    (table,) = run_sections.costs_section(results).blocks
    assert isinstance(table, pages.Table)
    rows = (["dataset", "7 s"], ["train_ddf", "2.0 min"], ["train_pcsiren", "not timed"])
    assert all(row in table.rows for row in rows)
    for path in folder.glob("*.json"):
        path.unlink()


def test_minutes_of_training_are_of_the_fastest():
    lasted = [{"chair": 70.0, "car": 60.0}, {"chair": 30.0, "car": 45.0}]
    logs = [{name: pd.DataFrame({"seconds": [1.0, last]}) for name, last in each.items()} for each in lasted]
    told = run_sections.budget(cast("stage_results.Results", SimpleNamespace(seeds=2, logs={"DDF": logs})))
    assert told.endswith("categories, of the fastest of 2 trainings: DDF 75 s.")


def test_damaged_and_missing_inputs_are_named(reported, tmp_path, monkeypatch):
    artifacts = shutil.copytree("artifacts", tmp_path / "artifacts") / "fake"
    monkeypatch.chdir(tmp_path)
    (artifacts / "train_pcsiren/plane/log.csv").unlink()
    with pytest.raises(FileNotFoundError, match=r"plane.log\.csv"):
        stage_results.read_results(reported[1])
    damage(artifacts / "evaluate/si3dr.csv")
    with pytest.raises(checks.InputError, match=r"si3dr\.csv is damaged"):
        stage_results.read_results(reported[1])

"""What the stages left behind is read, and named where it is missing."""

from pathlib import Path

import pandas as pd
import pytest

from ddf.core import checks, storage
from ddf_lab.evaluation import baselines, scoring, seed_means
from ddf_lab.report import pages, run_sections, stage_results


def test_further_seeds_are_evaluated_without_what_no_training_changes(seeded):
    artifacts = Path("artifacts") / "fake"
    first = storage.load_table(artifacts / "evaluate" / "si3dr.csv")[0]
    second = storage.load_table(artifacts / "evaluate_seeds" / "1" / "si3dr.csv")[0]
    assert set(second["method"]) == set(seed_means.TRAINED) - {scoring.DDF_ON_MASK} < set(first["method"])
    keys = ["category", "method", "column", "metric"]
    both = [table[table["method"] == baselines.RETRIEVAL].set_index(keys)["value"] for table in (first, second)]
    pd.testing.assert_series_equal(*both)  # the fake's features are those of seed 0


def test_times_are_summed_over_categories_and_memory_is_the_largest(reported):
    _, run, _ = reported
    folder = Path("artifacts") / "fake" / "times"
    for name, seconds in (("train_ddf-chair", 100), ("train_ddf-plane", 20), ("train_ddf-primitives", 3)):
        memory = {"peak_mib": 1000.0 + seconds, "worker_peak_mib": 0.0}
        storage.write_json(folder / f"{name}.json", {"seconds": seconds, **memory})
    storage.write_json(folder / "train_pcsiren-chair.json", {"seconds": 5, "peak_mib": 900.0, "worker_peak_mib": 0.0})
    storage.write_json(folder / "dataset.json", {"seconds": 7.0, "peak_mib": 300.0, "worker_peak_mib": 400.0})
    storage.write_json(folder / "evaluate.json", {"seconds": 9.0})  # of a version that noted no memory
    results = stage_results.read_results(run)
    found = results.costs
    assert found["train_ddf"] == stage_results.Cost(123.0, 1100.0)
    assert found["train_pcsiren"] == stage_results.Cost(None, None)
    assert found["dataset"] == stage_results.Cost(7.0, 400.0)
    assert found["evaluate"] == stage_results.Cost(9.0, None)
    (table,) = run_sections.costs_section(results).blocks
    assert isinstance(table, pages.Table)
    assert ["dataset", "7 s", "400"] in table.rows and ["train_ddf", "2.0 min", "1,100"] in table.rows
    for path in folder.glob("*.json"):
        path.unlink()


def test_damaged_and_missing_inputs_are_named(reported):
    _, run, _ = reported
    path = Path("artifacts/fake/evaluate/si3dr.csv")
    original = path.read_bytes()
    path.write_bytes(original.replace(b"measured", b"measurec", 1))
    with pytest.raises(checks.InputError, match=r"si3dr\.csv is damaged"):
        stage_results.read_results(run)
    path.write_bytes(original)
    log = Path("artifacts/fake/train_pcsiren/plane/log.csv")
    moved = log.rename(log.with_suffix(".moved"))
    with pytest.raises(FileNotFoundError, match=r"plane.log\.csv does not exist"):
        stage_results.read_results(run)
    moved.rename(log)

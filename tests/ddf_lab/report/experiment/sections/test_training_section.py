"""Wall time of both models."""

import dataclasses

from ddf_lab.report.experiment import stage_results
from ddf_lab.report.experiment.sections import training


def test_training_budgets_are_stated_with_their_difference(reported):
    results = stage_results.read_results(reported[1])
    longer = {name: log.assign(seconds=1.2 * log["seconds"]) for name, log in results.logs["DDF"].items()}
    text = training.budget(dataclasses.replace(results, logs={**results.logs, "DDF": longer}))
    assert "did not train for the same wall time" in text
    assert "DDF 12.0 min, PC-SIREN 10.0 min, the longer 20 % above the shorter" in text
    further = {"DDF": [654.0, 3000.0], "PC-SIREN": [600.0, 60.0]}  # beside 600 s of the first
    text = training.budget(dataclasses.replace(results, seeds=3, further_seconds=further))
    assert "within 9 %, summed over categories: DDF 10.9 min, PC-SIREN 10.0 min. Medians over the 3 seeds." in text
    text = (reported[2] / "README.md").read_text()
    assert training.budget(results) in text and "the same wall time within 0 %" in text

"""Sections of one run: budgets, and the settings that the page compares with the paper's."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import pytest
from _experiment_report import ROOT

from ddf_lab.report import run_sections, stage_results
from ddf_lab.run import Run


def test_training_times_are_summed(reported):
    results = stage_results.read_results(reported[1])
    longer = {name: log.assign(seconds=1.2 * log["seconds"]) for name, log in results.logs["DDF"].items()}
    two = {"DDF": longer, "PC-SIREN": results.logs["PC-SIREN"]}
    assert "DDF 12.0 min, PC-SIREN 10.0 min." in run_sections.budget(dataclasses.replace(results, logs=two))
    assert run_sections.budget(results) in (reported[2] / "README.md").read_text()
    assert [run_sections.duration(s) for s in (0.4, 89.0, 123.0, 7200.0)] == ["0 s", "89 s", "2.0 min", "2.0 h"]


def _changed(name):
    results: Any = SimpleNamespace(settings=Run.read(ROOT / "configs" / f"{name}.yaml").sections())
    changed, own = run_sections.changed_settings(results)
    return {key: rest for key, *rest in changed}, set(own)


@pytest.mark.parametrize("name", ["smoke", "cpu", "cpu_paper"])
def test_what_differs_from_the_paper_stands_beside_what_it_prints(name):
    (changed, own), (nothing, papers) = _changed(name), _changed("paper")
    assert all(here and there for here, there in changed.values())
    assert not nothing and papers <= own  # what the paper does not give stands in every page
    if name == "cpu":
        (proposals,) = (rest for key, rest in changed.items() if key.startswith("`ddf.proposals"))
        assert proposals == ["points 160", "none (app. si3dr)"]
        assert changed["`train.batch_size`"] == ["12", "32 (app. si3dr)"]

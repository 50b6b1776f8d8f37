"""Sections of one run: budgets, and the settings that the page compares with the paper's."""

from types import SimpleNamespace
from typing import Any

import pytest
from _experiment_report import ROOT

from ddf_lab.report import run_sections
from ddf_lab.run import Run


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

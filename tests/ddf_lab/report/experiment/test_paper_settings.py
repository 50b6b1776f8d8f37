"""The settings that the report compares with the paper's."""

import dataclasses

import pandas as pd
import pytest
from _experiment_report import ROOT

from ddf.core import checks
from ddf_lab.report.experiment import stage_results
from ddf_lab.report.experiment.paper_settings import NOT_GIVEN, SETTINGS
from ddf_lab.report.experiment.sections import limits
from ddf_lab.run import Run


@pytest.mark.parametrize("name", ["smoke", "cpu", "paper"])
def test_every_experiment_file_has_the_settings_that_the_report_prints(name):
    sections = Run.read(ROOT / "configs" / f"{name}.yaml").sections()
    settings = {section: dataclasses.asdict(value) for section, value in sections.items()}
    empty = pd.DataFrame()
    results = stage_results.Results(name, {}, empty, [], empty, empty, {}, {}, {}, empty, {}, settings)
    changed = limits.changed_settings(results)
    assert all(here for _, here, _ in changed)
    if name == "cpu":
        assert results.setting("ddf.proposals").startswith("points 160, directions 2, near 0.5")
        assert ("images per step", "12", "32 (app. si3dr)") in changed
    if name == "paper":  # what is left is what the paper does not give
        assert {printed for _, _, printed in changed} == {NOT_GIVEN}
        assert {row[0] for row in changed} == {each.name for each in SETTINGS if each.paper == NOT_GIVEN}
    with pytest.raises(checks.InputError, match=r"no key 'train\.nothing'"):
        results.setting("train.nothing")

"""The settings that the report compares with the paper's."""

import pandas as pd
import pytest
from _experiment_report import ROOT

from ddf.core import checks, config
from ddf.evaluation import scoring
from ddf.report.experiment import experiment_page, stage_results
from ddf.report.experiment.paper_settings import SETTINGS


@pytest.mark.parametrize("name", ["smoke", "cpu", "paper"])
def test_every_experiment_file_has_the_settings_that_the_report_prints(name):
    path = ROOT / "configs" / f"{name}.yaml"
    settings = config.read(path)
    empty = pd.DataFrame()
    results = stage_results.Results(name, {}, empty, empty, empty, empty, {}, {}, {}, empty, {}, settings)
    printed = [results.setting(key) for _, key, _ in SETTINGS]
    if name == "cpu":
        assert results.setting("ddf.proposals").startswith("points 160, directions 2, near 0.5")
    if name == "paper":
        wanted = [value for _, _, value in SETTINGS]
        assert all(have in (want, "all") for have, want in zip(printed, wanted, strict=True))
    with pytest.raises(checks.InputError, match=r"no key 'train\.nothing'"):
        results.setting("train.nothing")
    config.load(path, experiment_page.ReportConfig)
    config.load(path, scoring.EvaluateConfig)

"""Baselines and ceilings."""

from _experiment_report import markdown_tables

from ddf_lab.report.experiment.sections import bounds


def test_one_cycle_and_baseline_tables_have_every_row(reported):
    text = (reported[2] / "README.md").read_text()
    baseline, _, one_cycle, quoted = markdown_tables(text)[4:8]
    assert len(baseline) == 2 + 3 * len(bounds.ORDER)
    assert (
        len(one_cycle) == 2 + 12 and len(quoted) == 2 + 8 and "once" in one_cycle[0][2] and "3 times" in one_cycle[0][3]
    )
    ceiling = next(row for row in baseline if row[1] == "ceiling: truth against itself")
    mean = next(row for row in baseline if row[1] == "mean shape")
    assert float(ceiling[2]) < float(mean[2]) and float(ceiling[3]) > float(mean[3])
    assert "by the rule of claims. 4 images of each category." in text

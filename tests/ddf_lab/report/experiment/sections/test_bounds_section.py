"""Baselines and ceilings."""

import itertools

from _experiment_report import markdown_tables, measured

from ddf_lab.report.experiment import stage_results
from ddf_lab.report.experiment.sections import bounds


def test_one_cycle_and_baseline_tables_have_every_row(reported):
    text = (reported[2] / "README.md").read_text()
    baseline, _, one_cycle, quoted = markdown_tables(text)[3:7]
    assert len(baseline) == 2 + 3 * len(bounds.ORDER)
    assert (
        len(one_cycle) == 2 + 12 and len(quoted) == 2 + 8 and "once" in one_cycle[0][2] and "3 times" in one_cycle[0][3]
    )
    ceiling = next(row for row in baseline if row[1] == "ceiling: truth against itself")
    mean = next(row for row in baseline if row[1] == "mean shape")
    assert float(ceiling[2]) < float(mean[2]) and float(ceiling[3]) > float(mean[3])
    assert "more than two standard errors. 4 images of each category." in text


def test_distances_from_ceiling_and_retrieval_are_those_of_the_table(reported):
    _, run, folder = reported
    results = stage_results.read_results(run)
    value = measured(folder)
    text = (folder / "README.md").read_text()
    rows = markdown_tables(text)[4]
    assert len(rows) == 2 + 6 and "from the ceiling" in rows[0][2]
    for row, (category, method) in zip(
        rows[2:], itertools.product(("chair", "plane", "primitives"), ("ddf", "pc_siren")), strict=True
    ):
        own, ceiling, retrieved = (
            [value[category, who, "Pi_g-L", metric] for metric in ("chamfer_l2_sq_x1000", "f_score_tau_x100")]
            for who in (method, "ceiling", "retrieval")
        )
        assert row[2:4] == [f"{own[0] - ceiling[0]:+.3f}", f"{own[0] - retrieved[0]:+.3f}"]
        assert row[4:6] == [f"{own[1] - ceiling[1]:+.2f}", f"{own[1] - retrieved[1]:+.2f}"]
        heads = (method, "Pi_g-L"), ("retrieval", "Pi_g-L")
        for cell, metric in ((row[3], "chamfer_l2_sq_x1000"), (row[5], "f_score_tau_x100")):
            assert (f"**{cell}**" in text) == (results.better(category, *heads, metric) > 0)

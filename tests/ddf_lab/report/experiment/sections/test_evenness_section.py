"""Evenness of the clouds."""

from _experiment_report import markdown_tables, measured

from ddf_lab.evaluation import scoring


def test_evenness_of_the_clouds_is_printed_beside_that_of_the_truth(reported):
    _, _, folder = reported
    value = measured(folder)
    rows = next(rows for rows in markdown_tables((folder / "README.md").read_text()) if "of the truth's" in rows[0][3])
    names = ["true cloud", "as many of its points at random", "DDF", "DDF, N<sub>H</sub> = 1", "PC-SIREN"]
    assert [row[1] for row in rows[2:]] == 3 * names
    truth = value["plane", *scoring.TRUTH, "spacing_variation"]
    ddf = value["plane", "ddf", "Pi_g-L", "spacing_variation"]
    assert rows[7][2:] == [f"{truth:.2f}", "1.00"] and rows[9][2:] == [f"{ddf:.2f}", f"{ddf / truth:.2f}"]
    assert 0.2 < truth < 1 and 0.2 < ddf < 1

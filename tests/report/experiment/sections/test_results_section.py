"""The paper's table: every number is that of si3dr.csv, bold and verdict say what the numbers say."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
from _experiment_report import markdown_tables

from ddf.evaluation import paper_results, scoring
from ddf.report import pages
from ddf.report.experiment import experiment_page, scores, stage_results
from ddf.report.experiment.sections import results as results_section

_PAIRED = [
    (metric, method)
    for metric in ("chamfer_l2_sq_x1000", "f_score_tau_x100", "f_score_2tau_x100")
    for method in ("ddf", "pc_siren")
]


def _printed(value, key, digits):
    return f"{value[key]:.{digits}f}" if key in value else "–"


def test_printed_values_are_those_of_the_table(reported):
    _, _, folder = reported
    table = pd.read_csv(folder / "si3dr.csv")
    assert tuple(table.columns) == scoring.TABLE_FIELDS
    value = table.set_index(["source", "category", "method", "column", "metric"])["value"].to_dict()
    text = (folder / "README.md").read_text()
    ours, theirs, quoted = markdown_tables(text)[:3]
    assert len(ours) == 2 + 15 and len(theirs) == 2 + 10 and len(quoted) == 2 + 4  # the paper has no primitives
    assert "4 images of each category." in text
    for rows, source in ((ours, "measured"), (theirs, paper_results.SOURCE)):
        for i, row in enumerate(rows[2:]):
            category, column = ("chair", "plane", "primitives")[i // 5], results_section.COLUMNS[i % 5]
            assert row[0] == (category if i % 5 == 0 else "") and row[1] == scores.column_label(column)
            assert row[2:] == [
                _printed(value, (source, category, method, column, metric), 3 if metric.startswith("chamfer") else 2)
                for metric, method in _PAIRED
            ]
    corrected = [row for row in ours[2:] if "∇" in row[1]]
    assert len(corrected) == 3 and all(row[3] == row[5] == row[7] == "–" for row in corrected)  # PC-SIREN has none
    assert all("–" not in row[2] for row in ours[2:])
    for i, row in enumerate(quoted[2:]):
        numbers = paper_results.SI3DR[("chair", "plane")[i // 2]]
        assert row[1:] == [
            ("P2M", "3DR")[i % 2],
            *(f"{line[9 + i % 2]:.{d}f}" for line, d in zip(numbers, (3, 2, 2), strict=True)),
        ]


def test_bold_is_the_better_model_of_each_row(reported):
    text = (reported[2] / "README.md").read_text()
    lines = [line for line in text.splitlines() if line.startswith("| ") and "Π" in line][:15]
    for line in lines:
        cells = [cell.strip() for cell in line.strip("| ").split(" | ")][-6:]
        for (left, right), sign in zip((cells[:2], cells[2:4], cells[4:]), (1, -1, -1), strict=True):
            if right == "–":
                assert not left.startswith("**")
                continue
            gap = sign * (float(left.strip("*")) - float(right.strip("*")))
            assert left.startswith("**") == (gap < 0) and right.startswith("**") == (gap > 0)


def test_moved_shapes_are_told_where_shapes_are_moved(reported):
    _, config_path, folder = reported
    assert "moves until its silhouette" in (folder / "README.md").read_text()
    results = stage_results.read_results(config_path)
    clouds = {**results.settings["pointclouds"], "shape_correction": None}
    plain = dataclasses.replace(results, settings={**results.settings, "pointclouds": clouds})
    assert "moves until its silhouette" not in pages.markdown(experiment_page.build(plain))


def _results(gaps, seeds=1, spread=0.0):
    """Results of which only the D_C of both models at Pi_g-L are known: DDF is `gaps` above PC-SIREN, a shape each."""
    rows = [
        {
            "category": "car",
            "method": method,
            "column": "Pi_g-L",
            "id": str(i // 2),
            "view": i % 2,
            "chamfer_l2_sq": value,
        }
        for i, gap in enumerate(np.repeat(gaps, 2))  # two images a shape
        for method, value in ((scoring.DDF, (5 + gap) / 1000), (scoring.PC_SIREN, 5 / 1000))
    ]
    images = pd.DataFrame(rows)
    means = images.groupby("method")["chamfer_l2_sq"].mean() * 1000
    table = pd.DataFrame(
        [
            ("car", method, "Pi_g-L", "chamfer_l2_sq_x1000", mean, len(gaps), seeds, spread, scoring.MEASURED)
            for method, mean in means.items()
        ],
        columns=list(scoring.TABLE_FIELDS),
    )
    empty = pd.DataFrame()
    index = {"categories": {"car": {}}}
    return stage_results.Results("x", index, table, images, empty, empty, {}, {}, {}, empty, {}, {}, seeds=seeds)


@pytest.mark.parametrize(
    ("gaps", "seeds", "spread", "better"),
    [
        ([-1.0, -1.2, -0.8, -1.0], 1, 0.0, "DDF"),  # the mean is ten standard errors away
        ([1.0, 1.2, 0.8, 1.0], 1, 0.0, "PC-SIREN"),
        ([1.0, -1.2, 0.8, -1.0], 1, 0.0, ""),
        ([2.0, 0.0], 1, 0.0, ""),  # mean 1, standard error 1
        ([-1.0, -1.2, -0.8, -1.0], 4, 0.5, "DDF"),  # of the seeds sqrt((.25 + .25)/4) = .354
        ([-1.0, -1.2, -0.8, -1.0], 4, 0.9, ""),  # .636
        ([-1.0], 1, 0.0, ""),  # one shape says nothing of its spread
    ],
)
def test_a_difference_is_called_one_beyond_two_standard_errors(gaps, seeds, spread, better):
    assert results_section.better_model(_results(gaps, seeds, spread), "Pi_g-L") == {"car": better}


def test_verdict_names_wins_losses_and_what_is_even(reported, monkeypatch):
    results = stage_results.read_results(reported[1])
    found = {"Pi_g-L": {"chair": "DDF", "plane": "", "car": "DDF"}, "Pi_pred-L": {"chair": "PC-SIREN"}}
    assert results_section.verdict(results) in (reported[2] / "README.md").read_text().split("\n\n")[1]
    monkeypatch.setattr(results_section, "better_model", lambda _, column: found[column])
    assert results_section.verdict(results) == (
        "With the true camera, DDF is closer to the truth for chair and car; no difference between the models is seen "
        "for plane. With the predicted camera, PC-SIREN is closer to the truth for chair."
    )

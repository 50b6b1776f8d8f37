"""The paper's table: every number is that of si3dr.csv, bold and verdict say what the numbers say."""

import dataclasses

import pandas as pd
from _experiment_report import markdown_tables

from ddf.metrics import cloud_scores
from ddf_lab.evaluation import paper_results, scoring
from ddf_lab.report import pages
from ddf_lab.report.experiment import experiment_page, scores, stage_results
from ddf_lab.report.experiment.sections import results as results_section

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
    ours, shares, theirs, quoted = markdown_tables(text)[:4]
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
    names = [(metric, method) for metric in ("precision_tau_x100", "recall_tau_x100") for method in ("ddf", "pc_siren")]
    assert shares[2][2:] == [
        _printed(value, ("measured", "chair", method, "Pi_g-L", metric), 1) for metric, method in names
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


def test_bold_is_the_better_model_by_the_rule_of_claims(reported):
    results = stage_results.read_results(reported[1])
    lines = [line for line in (reported[2] / "README.md").read_text().splitlines() if line.startswith("| ")]
    lines = [line for line in lines if "Π" in line][:15]
    bold = 0
    for i, line in enumerate(lines):
        cells = [cell.strip() for cell in line.strip("| ").split(" | ")][-6:]
        category, column = ("chair", "plane", "primitives")[i // 5], results_section.COLUMNS[i % 5]
        ours, theirs = ((method, column) for _, method in results_section.MODELS)
        for (left, right), metric in zip((cells[:2], cells[2:4], cells[4:]), cloud_scores.PRINTED, strict=True):
            won = results.better(category, ours, theirs, metric)
            assert (left.startswith("**"), right.startswith("**")) == (won > 0, won < 0)
            bold += won != 0
    assert bold > 0


def test_findings_say_where_a_model_beats_retrieval_and_where_not(reported, monkeypatch):
    results = stage_results.read_results(reported[1])
    found = [line for line in results_section.findings(results) if "retrieval" in line]
    assert [line.split()[0] for line in found] == ["DDF", "PC-SIREN"]
    assert all(line in (reported[2] / "README.md").read_text() for line in found)
    won = {"chair": 1, "plane": 0, "primitives": -1}
    monkeypatch.setattr(stage_results.Results, "better", lambda self, category, *_: won[category])
    found = [line for line in results_section.findings(results) if "retrieval" in line]
    assert all(line.endswith(": better for chair; not for plane and primitives.") for line in found)


def test_shapes_on_the_mask_have_a_table_of_their_own(reported):
    """Work at test time that the other model is not given stands in no column beside it."""
    _, run, folder = reported
    text = (folder / "README.md").read_text()
    results = stage_results.read_results(run)
    assert results_section.on_the_mask(results) is None and "shapes moved until" not in text  # the fake moves no shape
    own = results.per_image[results.per_image["method"] == scoring.DDF]
    moved = own.assign(method=scoring.DDF_ON_MASK)
    table = results.table[results.table["method"] == scoring.DDF].assign(method=scoring.DDF_ON_MASK)
    both = dataclasses.replace(
        results, trainings=[pd.concat([results.per_image, moved])], table=pd.concat([results.table, table])
    )
    page = pages.markdown(experiment_page.build(both))
    assert "PC-SIREN is given no such descent here" in page
    mask = results_section.on_the_mask(both)
    assert mask is not None and not any(
        isinstance(cell, pages.Cell) and cell.best for row in mask.rows for cell in row
    )  # the same scores


def test_seconds_of_a_test_image_stand_beside_the_columns(reported):
    results = stage_results.read_results(reported[1])
    assert results_section.seconds(results) is None  # the fake noted none
    noted = {
        "DDF": {"encoders": 0.1, "cloud": 1.0, "camera_correction": 0.5},
        "PC-SIREN": {"encoders": 0.2, "cloud": 0.01},
    }
    table = results_section.seconds(dataclasses.replace(results, seconds=noted))
    assert table is not None
    assert [list(row) for row in table.rows] == [
        ["Π<sub>g</sub>, Π̂", "DDF", "1.10"],
        ["Π<sub>g</sub>, Π̂", "PC-SIREN", "0.21"],
        ["Π̂<sub>∇</sub>", "DDF", "1.60"],
    ]


def test_verdict_names_wins_losses_and_what_is_even(reported, monkeypatch):
    results = stage_results.read_results(reported[1])
    chair, car = ("chair", "D"), ("car", "D")
    found = {
        "Pi_g-L": {chair: "DDF", ("chair", "F"): "DDF", car: "", ("car", "F"): "PC-SIREN"},
        "Pi_pred-L": {chair: "", car: ""},
    }
    assert results_section.verdict(results) in (reported[2] / "README.md").read_text().split("\n\n")[1]
    monkeypatch.setattr(results_section, "better_model", lambda _, column: found[column])
    assert results_section.verdict(results) == (
        "With the true camera, DDF is better for chair (D and F); PC-SIREN is better for car (F); no other difference "
        "is seen. With the predicted camera, no difference is seen."
    )

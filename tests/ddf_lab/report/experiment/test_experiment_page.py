"""The report of a small experiment: every number comes from the table, nothing is loaded from outside."""

import itertools
import re

import pandas as pd
from _experiment_report import markdown_tables
from _fake_experiment import SIZES

from ddf_lab.evaluation import scoring, seed_means
from ddf_lab.report.experiment import experiment_page

_FILES = {"README.md", "si3dr.csv", "baselines.svg", "nearest.svg", "losses.svg"}


def test_every_file_and_category_is_there(reported):
    experiment, _, folder = reported
    names = _FILES | {"examples.webp"} | {f"strip_{category}.webp" for category in experiment.categories}
    assert {path.name for path in folder.iterdir()} == names
    linked = re.findall(r"\]\(([^)]+)\)", (folder / "README.md").read_text())
    assert set(linked) <= names and {name for name in names if name.endswith((".webp", ".svg"))} <= set(linked)


def test_paper_numbers_are_only_in_columns_that_say_so(reported):
    blocks = (reported[2] / "README.md").read_text().split("\n\n")
    tables = [(block, caption) for block, caption in itertools.pairwise(blocks) if block.startswith("|")]
    of_paper = {"| 62.25 |", "| 1.432 |", "| 54.37 |"}  # of tables si3dr and si3dr1h
    quoted = [caption for block, caption in tables if any(number in block for number in of_paper)]
    assert len(quoted) == 3 and all("paper" in caption for caption in quoted)
    assert not any("paper" in caption for _, caption in tables[:-1] if caption not in quoted)  # the last: settings
    table = pd.read_csv(reported[2] / "si3dr.csv")
    assert set(table["source"]) == {"measured", "paper, ShapeNet"}
    assert table[table["source"] != "measured"]["images"].isna().all()
    assert (table[table["source"] == "measured"]["images"] > 0).all()


def test_failures_losses_and_limits_are_named(reported):
    text = (reported[2] / "README.md").read_text()
    assert "3 shapes were left out" in text and "`plane99` (meshes): no triangles left" in text
    assert "0.20 / 0.20" in text and "6 of 6" in text
    assert "do not reproduce the paper's ShapeNet numbers" in text
    assert "| `train.encoder_width`: of both encoders' first layers; 64 is ResNet-18 | 16 | 64 (app. si3dr) |" in text
    assert f"{SIZES['L']} and {SIZES['S']} predicted points" in text
    assert "not timed" in text  # the fake has no times of its stages


def test_second_writing_gives_the_same_bytes(reported):
    _, run, folder = reported
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    experiment_page.write(run, folder.parent / "again")
    assert {path.name: path.read_bytes() for path in (folder.parent / "again").iterdir()} == before


def test_trained_rows_of_several_seeds_are_printed_with_their_spread(seeded):
    table = pd.read_csv(seeded[1] / "si3dr.csv")
    assert tuple(table.columns) == scoring.TABLE_FIELDS
    rows = table[table["source"] == scoring.MEASURED].set_index(["category", "method", "column", "metric"])
    trained = rows.index.get_level_values("method").isin(seed_means.TRAINED)
    assert (rows["seeds"] == trained + 1).all() and rows[trained]["spread"].notna().all()
    text = (seeded[1] / "README.md").read_text()
    tables = markdown_tables(text)
    row = rows.loc[("chair", "ddf", "Pi_g-L", "chamfer_l2_sq_x1000")]
    assert tables[0][2][2] == f"{row['value']:.3f} ± {row['spread']:.3f}" and row["spread"] > 0
    assert all("±" in cell or cell == "–" for line in tables[0][2:] for cell in line[2:])
    assert not any("±" in cell for rows in tables[2:4] for line in rows[2:] for cell in line)  # the paper's
    by_name = {line[1]: line[2:] for line in tables[4][2:]}
    assert all("±" in cell for cell in by_name["retrieval (nearest training image)"])
    assert not any("±" in cell for cell in by_name["mean shape"])
    cameras = next(rows for rows in tables if "azimuth" in rows[0][2])
    assert all("±" in cell for line in cameras[2:] for cell in line[2:-1])  # the last: no silhouettes were compared
    assert text.count("± is the standard deviation over 2 seeds") == 6
    assert text.count("Of the first of the 2 seeds.") == 7
    assert text.count("Medians over the 2 seeds.") == 1  # the budget
    assert text.count(" Means over 2 seeds.") == 3
    assert "2 seeds were trained" in text and "One seed was trained" not in text and "SEEDS=2`" in text


def test_pictures_and_paired_charts_are_of_the_first_seed(seeded):
    first, both = seeded
    names = {path.name for path in first.iterdir()}
    assert {path.name for path in both.iterdir()} == names
    same = {name for name in names if (first / name).read_bytes() == (both / name).read_bytes()}
    assert same == names - {"README.md", "si3dr.csv", "baselines.svg", "nearest.svg"}


def test_page_starts_with_a_verdict_and_a_picture_and_no_table_is_wide(reported):
    text = (reported[2] / "README.md").read_text()
    title, verdict, picture = text.split("\n\n")[:3]
    assert title == "# Results of the experiment fake" and verdict.count(". ") == 1 and verdict.endswith(".")
    assert picture.startswith("![") and picture.endswith("](examples.webp)")
    assert max(len(rows[0]) for rows in markdown_tables(text)) == 8

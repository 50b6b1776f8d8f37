"""The report of a small experiment: what comes of several seeds, equal bytes."""

import pandas as pd
from _experiment_report import markdown_tables

from ddf_lab.evaluation import scoring, seeds
from ddf_lab.report import experiment_page


def test_second_writing_gives_the_same_bytes(reported):
    _, run, folder = reported
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    experiment_page.write(run, folder.parent / "again")
    assert {path.name: path.read_bytes() for path in (folder.parent / "again").iterdir()} == before


def test_trained_rows_of_several_seeds_are_means_with_their_spread(seeded):
    first, both = seeded
    table = pd.read_csv(both / "si3dr.csv")
    assert tuple(table.columns) == scoring.TABLE_FIELDS
    rows = table[table["source"] == scoring.MEASURED].set_index(["category", "method", "column", "metric"])
    trained = rows.index.get_level_values("method").isin(seeds.TRAINED)
    assert (rows["seeds"] == trained + 1).all() and rows[trained]["spread"].notna().all()
    ours = markdown_tables((both / "README.md").read_text())[1]
    row = rows.loc[("chair", "ddf", "Pi_g-L", "chamfer_l2_sq_x1000")]
    assert ours[2][2] == f"{row['value']:.3f} ± {row['spread']:.3f}" and row["spread"] > 0
    told = [(cell, line[1]) for line in ours[2:] for cell in line[2:] if cell != "–"]
    assert all(("±" in cell) == column.endswith("L") for cell, column in told)
    same = {path.name for path in first.iterdir() if path.read_bytes() == (both / path.name).read_bytes()}
    assert same == {path.name for path in first.iterdir()} - {"README.md", "si3dr.csv", "per_image.csv", "nearest.svg"}

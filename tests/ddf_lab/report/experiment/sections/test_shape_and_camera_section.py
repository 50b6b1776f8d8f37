"""Where the error comes from: parts that add up."""

import pytest
from _experiment_report import markdown_tables, measured


def test_shape_and_camera_add_up_to_the_score_with_the_predicted_camera(reported):
    _, _, folder = reported
    value = measured(folder)
    tables = markdown_tables((folder / "README.md").read_text())
    split, f_scores = (rows for rows in tables if len(rows[0]) == 6 and "camera" in rows[0][4])
    assert len(split) == len(f_scores) == 2 + 9
    for row in [*split[2:], *f_scores[2:]]:
        ceiling, shape, camera, whole = map(float, row[2:6])
        assert ceiling + shape + camera == pytest.approx(whole, abs=0.021)  # of numbers rounded to 0.01
    ceiling, placed, whole = (
        value["plane", *head, "chamfer_l2_sq_x1000"]
        for head in (("ceiling", "Pi_g-S"), ("ddf", "Pi_g-S"), ("ddf", "Pi_corrected-S"))
    )
    row = split[2 + 4]
    assert row[1].startswith("DDF, Π̂<sub>∇</sub>")
    assert row[2:6] == [f"{ceiling:.3f}", f"{placed - ceiling:+.3f}", f"{whole - placed:+.3f}", f"{whole:.3f}"]

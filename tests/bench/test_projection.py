"""Projection to the published setting: the arithmetic behind reports/growth.md."""

import pytest

from bench.growth import projection
from ddf.data import splits


def test_split_has_the_published_numbers_of_shapes():
    split = projection.Split.of(projection.LINES)
    assert (split.shapes, split.train_images, split.test_images) == (18_319, 73_276, 18_319)
    by_category = [projection.Split.of({name: lines}) for name, lines in projection.LINES.items()]
    assert [part.shapes for part in by_category] == [6_778, 4_045, 7_496]
    assert split.pairs == sum(part.pairs for part in by_category)


def test_split_agrees_with_the_rule_by_which_lists_are_made():
    ids = [f"{i:05d}" for i in range(1, 4_046)]
    shapes = splits.split_class("02691156", ids)
    lines = sum(len(s.train_views) for s in shapes), sum(len(s.test_views) for s in shapes)
    assert lines == projection.LINES["plane"]
    train, test = (sum(len(getattr(s, side)) > 2 for s in shapes) for side in ("train_views", "test_views"))
    assert projection.Split.of({"plane": projection.LINES["plane"]}).pairs == train * test


def test_slope_is_per_shape_whatever_the_order():
    assert projection.slope((30, 300), (100.0, 127.0)) == pytest.approx(0.1)
    assert projection.slope((300, 30), (127.0, 100.0)) == pytest.approx(0.1)


def test_a_map_is_linear_in_units_and_cores():
    assert projection.map_hours(2.0, 18_000, 2) == pytest.approx(5.0)
    assert projection.map_hours(2.0, 18_000, 64) == pytest.approx(5.0 * 2 / 64)


@pytest.mark.parametrize(("cores", "hours"), [(1, 30.0), (2, 30.0), (4, 20.0), (6, 10.0), (64, 10.0)])
def test_trainings_run_side_by_side_but_none_gets_faster(cores, hours):
    assert projection.training_hours(0.36, 2, 100_000, 3, cores) == pytest.approx(hours)


def test_step_is_found_by_model_and_device():
    rows = [
        {"what": "ddf", "size": {"device": "cuda"}, "median_s": 0.1},
        {"what": "ddf, paper.yaml", "size": {}, "median_s": 9.0},
        {"what": "pcsiren", "size": {"device": "cpu"}, "median_s": 1.0},
    ]
    record = {"rows": rows}
    assert [projection.find_step(record, "ddf", device) for device in ("cuda", "cpu")] == rows[:2]
    assert projection.find_step(record, "pcsiren", "cpu") == rows[2]
    assert projection.find_step(record, "pcsiren", "cuda") is None
    assert projection.find_step(None, "ddf", "cpu") is None


def test_bytes_of_trainings_and_clouds():
    assert projection.bytes_of_training(1_000) == 16_000
    assert projection.bytes_of_clouds(2, 1, 8, train_images=5, test_images=10) == 12 * 3 * 3 * 10 + 4 * 8 * 15


def test_a_sum_with_an_unknown_part_is_unknown():
    assert projection.together([1.0, 2.5]) == 3.5
    assert projection.together([1.0, None]) is None

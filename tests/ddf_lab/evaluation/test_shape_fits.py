"""One sample type left out: as many samples, steps and points in a step, none of that type; and the paper's table."""

import dataclasses

import pytest
from _shapes import cube
from _tiny_fits import TINY

from ddf.core import storage
from ddf.data.samples import sample_types
from ddf.fields import losses, shape_field
from ddf_lab.evaluation import paper_results, shape_fits

CONFIG = dataclasses.replace(TINY, steps=2)


@pytest.fixture(autouse=True)
def _small(monkeypatch):
    monkeypatch.setattr(shape_fits, "SAMPLES", 3000)
    monkeypatch.setattr(shape_fits, "HELD_OUT", 60)


def test_every_fit_has_the_same_number_of_samples():
    for without in (None, *paper_results.BUNNY_TYPES):
        chosen = shape_fits.without_type(CONFIG, without, None)
        drawn = {kind: count for kind, count in chosen.samples.items() if kind != without}
        assert set(drawn.values()) == {500 if without is None else 600}
        assert sum(drawn.values()) == 3000
        assert (chosen.steps, chosen.held_out) == (2, 60)


def test_a_left_out_type_is_in_no_step_and_yet_in_the_errors(tmp_path, monkeypatch):
    seen = []
    shape_loss = losses.shape_loss

    def watched(field, batch, *rest):
        seen.append((dict(batch.counts), batch.positions.shape[1]))
        return shape_loss(field, batch, *rest)

    monkeypatch.setattr(losses, "shape_loss", watched)
    results = shape_fits.leave_one_out(cube(), CONFIG, tmp_path, {"cube.ply": "abc"})
    assert list(results) == [shape_fits.NONE, *paper_results.BUNNY_TYPES]
    assert [len(counts) for counts, _ in seen] == [7] * 2 + [6] * 12
    for i, without in enumerate(paper_results.BUNNY_TYPES):
        for counts, total in seen[2 + 2 * i : 4 + 2 * i]:
            assert without not in counts
            assert counts == {kind: 20 if kind == "E" else 24 for kind in sample_types.ORDER if kind != without}
            assert total == 140
    for name, found in results.items():
        assert set(found["held_out"]["depth_l1"]) == set("UABSTO")
        assert (found["steps"], found["samples"]) == (2, 3000)
        shape_field.load(tmp_path / f"without_{name}")
    assert len({str(found["held_out"]) for found in results.values()}) == 7
    assert storage.read_json(tmp_path / shape_fits.RESULTS) == storage._null_for_nan(results)


def test_tables_have_every_row_of_ours_and_of_the_paper():
    errors = {metric: dict.fromkeys(shape_fits.TYPES, 0.25) for metric in paper_results.BUNNY_METRICS}
    table = shape_fits.ablation_table({name: {"held_out": errors} for name in ("none", "S")})
    assert list(table) == ["without", "type", "metric", "value", "source"]
    assert len(table) == 2 * 2 * 6 * 2
    value = table.set_index(["source", "without", "type", "metric"])["value"]
    assert value["measured", "S", "U", "depth_l1_x10"] == 0.25
    assert value["paper, bunny", "S", "S", "depth_l1_x10"] == 1.43
    assert value["paper, bunny", "none", "O", "visibility_bce"] == 0.56
    angles = {"normal_angle_deg": {"U": {"median": 1.0, "p95": 9.0}}, "normal_angle_deg_median": 2.0}
    table = shape_fits.fit_table({**errors, **angles, "normal_angle_deg_p95": None})
    value = table[table["source"] == "measured"].set_index(["type", "metric"])["value"]
    assert value["UAB", "normal_angle_deg_median"] == 2.0 and value["U", "normal_angle_deg_p95"] == 9.0
    assert value["S", "visibility_bce"] == 0.25 and value.isna().sum() == 1

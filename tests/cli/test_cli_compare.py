"""`ddf compare` end to end: keys, values and refusals."""

import json

import numpy as np
import pytest

from ddf import cli
from ddf.evaluation import metrics
from ddf.geometry import point_io

_KEYS = {"chamfer_l2_sq", "f_score_tau", "f_score_2tau", "precision_tau", "recall_tau", "num_pred", "num_truth"}


@pytest.fixture
def clouds(tmp_path):
    generator = np.random.default_rng(0)
    points = {"pred": generator.normal(size=(80, 3)) * 0.05, "truth": generator.normal(size=(120, 3)) * 0.05}
    for name, values in points.items():
        (tmp_path / f"{name}.ply").write_bytes(point_io.points_ply(values))
    return {name: str(tmp_path / f"{name}.ply") for name in points}


def test_json_holds_the_scores_of_the_library(clouds, capfd):
    assert cli.main(["compare", clouds["pred"], clouds["truth"], "--tau-sq", "4e-4", "--json"]) == 0
    got = json.loads(capfd.readouterr().out)
    assert got.keys() >= _KEYS
    pred, truth = (point_io.read_points(clouds[name]) for name in ("pred", "truth"))
    expected = vars(metrics.compare_clouds(pred, truth, 4e-4))
    assert {key: got[key] for key in _KEYS} == expected and 0 < got["f_score_tau"] < 1


def test_default_threshold_is_tau_and_text_names_every_score(clouds, capfd):
    assert cli.main(["compare", clouds["pred"], clouds["truth"]]) == 0
    lines = dict(line.split(": ") for line in capfd.readouterr().out.splitlines())
    assert lines.keys() >= _KEYS and float(lines["tau_sq"]) == 1e-4


def test_bad_input_is_one_line_and_code_two(clouds, tmp_path, capfd):
    (tmp_path / "empty.ply").write_bytes(point_io.points_ply(np.zeros((0, 3))))
    for arguments in (
        [clouds["pred"], str(tmp_path / "empty.ply")],
        [clouds["pred"], str(tmp_path / "absent.ply")],
        [clouds["pred"], clouds["truth"], "--tau-sq", "0"],
    ):
        assert cli.main(["compare", *arguments, "--json"]) == 2
        captured = capfd.readouterr()
        assert captured.out == "" and captured.err.count("\n") == 1 and captured.err.startswith("ddf compare: error: ")

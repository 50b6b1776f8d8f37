"""`ddf info`: exact counts, the stages, and a cost stated before anything has run."""

import json
from pathlib import Path

from ddf import cli

ROOT = Path(__file__).resolve().parents[2]


def test_info_counts_and_lists(capsys):
    assert cli.main(["info", str(ROOT / "configs" / "paper.yaml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    counts = {"ddf": 25_647_367, "pc_siren": 25_645_574}
    assert counts.items() <= found["parameters"].items() and "single_shape" not in found["parameters"]
    assert found["stages"][0] == "dataset@paper" and found["stages"][-1] == "report@paper"
    assert "train_ddf@paper-chair" in found["stages"]
    steps = dict.fromkeys(("ddf", "pcsiren", "ddf_image"), 100_000)
    shapes = dict.fromkeys(("chair", "plane", "car"))
    assert found["cost"] == {"shapes": shapes, "samples_per_shape": 80_000, "steps": steps, "trainings": 9}

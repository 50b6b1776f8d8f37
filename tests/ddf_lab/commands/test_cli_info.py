"""`ddf info`: exact counts, the stages, and a cost stated before anything has run."""

import json
from pathlib import Path

import pytest
import torch

from ddf import cli
from ddf.core import storage
from ddf_lab.engine import experiment_cost
from ddf_lab.run import Run

ROOT = Path(__file__).resolve().parents[3]


def test_info_counts_and_lists(capsys):
    assert cli.main(["info", str(ROOT / "configs" / "paper.yaml"), "--no-steps", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["parameters"]["ddf"] == 25_647_367
    assert found["parameters"]["pc_siren"] == 25_645_574
    assert found["parameters"]["single_shape"] == 1_581_572
    assert found["stages"][0] == "dataset@paper"
    assert found["stages"][-1] == "report@paper"
    assert "train_ddf@paper-chair" in found["stages"]
    cost = found["cost"]
    assert cost["shapes"] == {"chair": None, "plane": None, "car": None, "all": None} and cost["samples"] is None
    assert cost["per_shape"] == {"samples": 80_000, "bytes": 80_000 * 14 + 8_000 * 13}
    assert cost["disk_bytes"] == {"samples": None, "trainings": 3 * 4 * 4 * (25_647_367 + 25_645_574)}
    assert cost["steps"] == {"ddf": 100_000, "pcsiren": 100_000} and cost["trainings"] == 6
    assert cost["steps_in_all"] == {"ddf": 300_000, "pcsiren": 300_000}
    assert cost["training_time"] is None


def test_info_ends_with_a_verdict(capsys):
    for name, told in (("paper", "ddf with 25,647,367 parameters; 6 trainings"), ("generative", "parameters")):
        path = ROOT / "configs" / f"{name}.yaml"
        assert cli.main(["info", str(path), "--no-steps"]) == 0
        last = capsys.readouterr().out.splitlines()[-1]
        assert last.startswith(f"{path}: ") and last.endswith(told)


def test_info_states_the_time_of_the_trainings_from_measured_steps(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(experiment_cost.os, "cpu_count", lambda: 1)
    before = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    assert cli.main(["info", str(ROOT / "configs" / "smoke.yaml"), "--json"]) == 0
    assert before == (torch.get_num_threads(), torch.are_deterministic_algorithms_enabled())
    cost = json.loads(capsys.readouterr().out)["cost"]
    assert cost["shapes"] == {"primitives": 12, "all": 12} and cost["samples"] == 12 * 8_000
    time = cost["training_time"]
    assert time["threads"] == 1 and time["device"] in ("cpu", "cuda")
    hours = 0.0
    for name, steps in cost["steps_in_all"].items():
        assert time[name]["step_seconds"] > 0 and 2 <= time[name]["measured_images"] <= time["batch_size"] == 4
        assert time[name]["hours"] == pytest.approx(time[name]["step_seconds"] * steps / 3600)
        hours += time[name]["hours"]
    assert time["hours"] == pytest.approx(hours)


def test_info_counts_the_steps_of_all_categories(tmp_path):
    path = tmp_path / "mine.yaml"
    text = (ROOT / "configs" / "smoke.yaml").read_text()
    path.write_text(text.replace("{primitives: 12}", "{chair: 5, car: 5}"))
    cost = experiment_cost.predict(Run.read(path), measured=False)
    assert cost["steps_in_all"] == {name: 2 * stated for name, stated in cost["steps"].items()}


def test_info_counts_the_shapes_that_the_dataset_stage_has_listed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shapes = [{"id": name, "train_views": [0], "test_views": []} for name in "abc"]
    index = {"categories": {"chair": {"synset": "03001627", "shapes": shapes}}}
    storage.write_json(Path("artifacts/paper/dataset/index.json"), index)
    run = Run.read(ROOT / "configs" / "paper.yaml")
    run.given["dataset"].append(("here", {"categories": {"chair": None, "car": 7}}))
    assert experiment_cost.count_shapes(run) == {"chair": 3, "car": 7}


def test_info_names_an_unknown_key(tmp_path, capsys):
    path = tmp_path / "mine.yaml"
    path.write_text((ROOT / "configs" / "cpu.yaml").read_text().replace("encoder_width:", "encoder_widht:"))
    assert cli.main(["info", str(path)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"ddf info: error: {path}: train: unknown key 'encoder_widht'")
    assert len(error.splitlines()) == 1

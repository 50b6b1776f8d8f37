"""`ddf info`: exact counts, the stages, and a cost stated before anything has run."""

import json
import shutil
from pathlib import Path

from ddf import cli
from ddf.core import storage
from ddf.data.public import manifest
from ddf_lab import commands

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


def test_the_end_of_a_run_is_the_first_sentence_and_table_of_its_page(tmp_path):
    page = tmp_path / "README.md"
    page.write_text(
        "# A\n\nBest is A.\n\n![x](x)\n\n|  | D<sub>C</sub> |\n| :-- | --: |\n| a |  |\n| b | **1** |\n\n| c |\n"
    )
    assert commands.summary(page) == ["Best is A.", "   DC", "a", "b  1"]
    assert commands.summary(tmp_path) == []


def test_info_counts_shapes_that_are_listed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "configs", "configs")
    shutil.copy(ROOT / "pipeline.yaml", ".")
    rows = "".join(f"{name},{split}{',' * 11}\n" for name, split in (("a,chair", "train"), ("b,sofa", "train")))
    storage.write_text(Path("own/manifest.csv"), f"{','.join(manifest.COLUMNS)}\n{rows}")
    own = "{source: own, own: own, categories: {chair: null, sofa: null}, public: {copies: 4}}"
    Path("configs/mine.yaml").write_text(f"base: smoke\ndataset: {own}\n")
    shapes = [{"id": name, "train_views": [0], "test_views": []} for name in "abc"]
    storage.write_json(Path("artifacts/mine/dataset/index.json"), {"categories": {"chair": {"shapes": shapes}}})
    assert cli.main(["info", "configs/mine.yaml", "--json"]) == 0
    cost = json.loads(capsys.readouterr().out)["cost"]
    assert cost["shapes"] == {"chair": 3, "sofa": 1} and cost["samples_per_shape"] == 8_000

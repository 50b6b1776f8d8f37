"""`ddf split`: the lists that Pixel2Mesh trains and tests on."""

import json

import pytest

from ddf.data import splits

CHAIR, CAR = "03001627", "02958343"


def test_both_lists_are_written_and_reported(tmp_path, answer):
    source = tmp_path / "ids.json"
    source.write_text(json.dumps({CHAIR: ["a", "b", "c"]}))
    result = answer("split", source, "--out", tmp_path / "out")
    for part, count in (("train", 12), ("test", 3)):
        data = (tmp_path / "out" / f"{part}_list.txt").read_text()
        assert result[part]["lines"] == count == data.count("\n")
        assert result[part]["git_blob"] == splits.git_blob_id(data)
    assert result["classes"] == {CHAIR: {"shapes": 3, "train": 12, "test": 3}}
    assert result["straddling"] == [f"{CHAIR}/c"]
    assert answer("split", source, "--out", tmp_path / "strict", "--strict")["straddling"] == []


def test_folder_and_json_give_the_same_lists(tmp_path, answer):
    ids = {CHAIR: ["a10", "a9", "b1"], CAR: ["u2-1", "u10"]}
    for synset, names in ids.items():
        for name in names:
            (tmp_path / "root" / "ShapeNetRendering" / synset / name / "rendering").mkdir(parents=True)
    (tmp_path / "ids.json").write_text(json.dumps(ids))
    one, other = (answer("split", tmp_path / source, "--out", tmp_path / "out") for source in ("root", "ids.json"))
    assert one["train"] == other["train"] and one["test"] == other["test"]


@pytest.mark.real
def test_official_lists_come_out_byte_for_byte(shared_dir, tmp_path, answer):
    result = answer("split", shared_dir / "p2m" / "r2n2_ids.json", "--out", tmp_path)
    assert (tmp_path / "train_list.txt").stat().st_size == 13_287_304
    assert result["train"]["git_blob"] == "da744d32c3894d9aebd1bce28560725275f1f560"
    assert result["test"]["git_blob"] == "0a7f7c537eadaa43926f93b76b022b6b860483b2"
    counts = {synset: (entry["train"], entry["test"]) for synset, entry in result["classes"].items()}
    assert (counts[CHAIR], counts["02691156"], counts[CAR]) == ((27112, 6778), (16180, 4045), (29984, 7496))
    assert len(result["straddling"]) == 11
    assert [name.split("/")[0] for name in result["straddling"]].count("02691156") == 0

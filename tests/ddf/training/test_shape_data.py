"""Parts of a category: what is learned, held out and pictured never meets."""

import _hand_made
import numpy as np
import pytest

from ddf.core import checks, storage
from ddf.data.batches import category_data
from ddf.training import shape_data


def _write(folder, all_ids, sampled):
    listing = [{"id": name, "train_views": [0], "test_views": []} for name in all_ids]
    index = {"root": folder.as_posix(), "categories": {"car": {"synset": "02958343", "shapes": listing}}}
    storage.write_json(folder / "index.json", index)
    name = f"000{category_data.SAMPLES}"
    storage.save_tensors(folder / "samples" / name, {"x": np.zeros(1)}, {"ids": sampled})
    storage.write_json(folder / "samples" / "000.json", {"files": {name: ""}})
    return folder / "index.json", folder / "samples"


def test_no_shape_is_in_two_parts(tmp_path):
    ids = [f"s{i}" for i in range(8)]
    found = shape_data.parts(*_write(tmp_path, ids, ids[1:8:2]), "car", 1)
    assert (found.learned, found.held_out, found.pictured) == (["s1", "s3", "s5"], ["s7"], ["s0", "s2", "s4", "s6"])
    assert not {*found.learned, *found.held_out} & {*found.pictured}


def test_too_few_shapes_are_told(tmp_path):
    places = _write(tmp_path, ["a", "b"], ["a", "b"])
    with pytest.raises(checks.InputError, match=r"2 shapes have samples, of which vae.held_out takes 1"):
        shape_data.parts(*places, "car", 1)
    with pytest.raises(checks.InputError, match="every shape has samples"):
        shape_data.read_pictured(*places, "car")


def test_clouds_have_the_surface_samples_of_their_shape():
    shapes = shape_data.Shapes(["a", "b", "c"], _hand_made.samples(), np.ones(3))
    positions, _ = shapes.clouds(np.array([2, 0]), 4, np.random.default_rng(0))
    stored = _hand_made.shards()[1]["S.positions"][0]
    assert all((stored == np.rint(p * 32767)).all(axis=1).any() for p in positions[0].numpy())

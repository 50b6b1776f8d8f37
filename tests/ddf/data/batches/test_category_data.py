"""Images, shapes and samples of a category: what is read and what a batch draws."""

import errno
import logging
import os
import tempfile
from pathlib import Path

import _hand_made
import numpy as np
import pytest
import torch
from _hand_made import COUNTS
from _support import damage

from ddf.core import checks, storage
from ddf.data import shapenet
from ddf.data.batches import category_data
from ddf.data.public import manifest
from ddf.data.samples import sample_types
from ddf.geometry import transforms


def test_drawn_samples_belong_to_their_shapes_and_types():
    batch = _hand_made.samples().draw(np.array([2, 0]), COUNTS, np.random.default_rng(0))
    known = batch.span(*sample_types.GROUND_TRUTH)
    assert batch.positions.shape == (2, sum(COUNTS.values()), 3)
    torch.testing.assert_close(batch.directions.norm(dim=-1), torch.ones(2, sum(COUNTS.values())), atol=1e-5, rtol=0)
    for row, depth in ((0, 0.75), (1, 0.25)):
        seen = batch.visible[row, known] == 1
        assert 0 < int(seen.sum()) < len(seen)
        found = batch.depth[row, known][seen]
        torch.testing.assert_close(found, torch.full_like(found, depth), atol=1e-4, rtol=0)
        assert bool((batch.depth[row, known][~seen] == 0).all())
    cosine = (batch.normals * batch.directions).sum(-1)[:, known]
    assert float(cosine.max()) < -0.99


def test_shards_give_what_was_written(tmp_path):
    ids, samples = [f"shape{i}" for i in range(3)], _hand_made.samples()
    points = [np.random.default_rng(i).random((5 + i, 3)).astype(np.float32) for i in range(3)]
    for number, rows in enumerate(([0, 1], [2])):
        names = [ids[i] for i in rows]
        frames = {name: transforms.Similarity(2.0 + i).to_dict() for i, name in zip(rows, names, strict=True)}
        written = {f"{number}{category_data.SAMPLES}": "", f"{number}{category_data.CLOUDS}": ""}
        path = tmp_path / f"{number}{category_data.SAMPLES}"
        storage.save_tensors(path, _hand_made.shards()[number], {"ids": names, "field_from_raw": frames})
        arrays = {"points": np.concatenate([points[i] for i in rows])}
        arrays["offsets"] = np.cumsum([0, *(len(points[i]) for i in rows)])
        arrays["hidden"] = np.zeros(len(arrays["points"]), dtype=bool)
        storage.save_tensors(tmp_path / f"{number}{category_data.CLOUDS}", arrays, {"ids": names})
        storage.write_json(tmp_path / f"{number:03d}.json", {"files": written})
    read, shapes = category_data.read_samples(tmp_path, ids[::-1]), category_data.read_shapes(tmp_path, ids[::-1])
    both = ((samples, [2, 0, 1]), (read, [0, 2, 1]))
    drawn = (whole.draw(np.array(order), COUNTS, np.random.default_rng(0)) for whole, order in both)
    for one, two in zip(*(vars(batch).values() for batch in drawn), strict=True):
        assert torch.equal(one, two) if isinstance(one, torch.Tensor) else one == two
    for i in range(3):
        torch.testing.assert_close(shapes.cloud(i), torch.from_numpy((4.0 - i) * points[2 - i]), rtol=1e-6, atol=0)
    damage(tmp_path / f"1{category_data.CLOUDS}")
    with pytest.raises(checks.InputError, match=r"1\.clouds\.safetensors is damaged"):
        category_data.read_shapes(tmp_path, ids)
    with pytest.raises(checks.InputError, match="no samples of shape other"):
        category_data.read_samples(tmp_path, [*ids, "other"])


def test_a_file_without_a_name_holds_what_is_written_and_needs_its_space(monkeypatch):
    held = category_data.mapped((3, 2), np.int16)
    held[1] = torch.tensor([5, -7], dtype=torch.int16)
    assert held.tolist() == [[0, 0], [5, -7], [0, 0]]

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OSError, match=tempfile.gettempdir()):
        category_data.mapped((3, 2), np.int16)


def test_only_what_has_room_goes_to_a_device(monkeypatch, caplog):
    """Of a device whose memory is as large as told; the tensors stay on the CPU."""
    images, shapes, samples = _hand_made.images(), _hand_made.shapes(), _hand_made.samples()
    sizes = {"images": 6 * 4 * 32 * 32 + 6 * 12, "clouds": 3 * 80 * 12, "samples": 3 * 6 * 40 * 14}
    monkeypatch.setattr(category_data, "room", lambda device: sizes["images"] + sizes["samples"] - 1)
    memory = category_data.DeviceMemory(torch.device("meta"))
    with caplog.at_level(logging.INFO):
        assert memory.holds("images", images).images.is_meta
        assert memory.holds("samples", samples) is samples and memory.left == sizes["samples"] - 1
        assert memory.holds("clouds", shapes).points.is_meta
    assert memory.left == sizes["samples"] - 1 - sizes["clouds"]
    assert category_data.DeviceMemory(torch.device("cpu")).holds("images", images) is images
    assert "samples of the training set" in caplog.text and "in files: the GPU has no room for them" in caplog.text


def test_test_views_are_the_first_of_the_splits_and_public_shapes_have_their_own_number():
    public = next(row.id for row in manifest.of(["chair"]) if row.split == "test")
    rows = (("a", (0, 1, 2, 3, 4), ()), ("b", (0, 1), (2, 3, 4)), (public, (), (0, 1, 2, 3, 4)))
    category = shapenet.CategoryEntry("1", tuple(shapenet.ShapeEntry(*row) for row in rows))
    data = shapenet.Dataset(Path("root"), {"chair": category})
    assert data.views("chair", "train") == [("a", (0, 1, 2, 3, 4)), ("b", (0, 1))]
    assert category_data.test_views(data, "chair", 1, 3) == [("b", (2,)), (public, (0, 1, 2))]
    assert category_data.test_views(data, "chair", 2) == [("b", (2, 3)), (public, (0, 1, 2, 3, 4))]
    with pytest.raises(checks.InputError, match="it has chair"):
        data.category("plane")

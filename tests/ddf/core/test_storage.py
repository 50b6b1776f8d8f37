"""Files that are whole or absent."""

import errno
import os
from typing import Literal

import numpy as np
import pandas as pd
import pytest
import torch

from ddf.core import checks, storage

ARRAYS = {
    "positions": np.arange(12, dtype=np.int16).reshape(2, 2, 3),
    "depth": np.array([0, 65535], dtype=np.uint16),
    "scalar": np.array(1.5, dtype=np.float32),
    "empty": np.zeros((0, 3)),
    "strided": np.arange(12.0).reshape(3, 4).T[::2],
    "flags": np.array([True, False]),
}


@pytest.mark.parametrize("how", ["numpy", "torch", "mapped"])
def test_tensors_come_back_bit_for_bit(tmp_path, how: Literal["numpy", "torch", "mapped"]):
    path = tmp_path / "deep" / "a.safetensors"
    storage.save_tensors(path, {**ARRAYS, "weights": torch.linspace(0, 1, 5)}, {"seed": 3, "ids": ["a", "b"]})
    tensors = storage.map_tensors(path) if how == "mapped" else storage.load_tensors(path, how)[0]
    assert set(tensors) == {*ARRAYS, "weights"}
    for name, array in ARRAYS.items():
        found = np.asarray(tensors[name])
        assert found.dtype == array.dtype
        np.testing.assert_array_equal(found, array)
    for metadata in (storage.load_tensors(path)[1], storage.load_metadata(path)):
        assert (metadata["seed"], metadata["ids"]) == (3, ["a", "b"])
        assert metadata["format_version"] == storage.FORMAT_VERSION
        assert metadata["packages"]["numpy"] == np.__version__


def test_table_comes_back_bit_for_bit(tmp_path):
    table = pd.DataFrame({"id": ["a", "b,c"], "value": [1 / 3, 1e-300], "count": [1, 2]})
    storage.save_table(tmp_path / "t.csv", table, {"seed": 1})
    found, metadata = storage.load_table(tmp_path / "t.csv")
    pd.testing.assert_frame_equal(found, table, check_exact=True)
    assert metadata["seed"] == 1


def test_every_flipped_bit_and_every_truncation_is_noticed(tmp_path):
    arrays, table = tmp_path / "a.safetensors", tmp_path / "a.csv"
    storage.save_tensors(arrays, {"x": np.arange(3, dtype=np.int16)}, {"seed": 1})
    storage.save_table(table, pd.DataFrame({"x": [1, 2]}), {})
    for path, load in ((arrays, storage.load_tensors), (table, storage.load_table)):
        good = path.read_bytes()
        for i in range(len(good)):
            for damaged in (good[:i] + bytes([good[i] ^ (1 << (i % 8))]) + good[i + 1 :], good[:i]):
                path.write_bytes(damaged)
                with pytest.raises(checks.InputError, match=path.name):
                    load(path)
        path.write_bytes(good)
        load(path)


def test_foreign_files_are_refused_in_one_line(tmp_path):
    for content in (b"", b"hello\nworld", b"\0" * 100, b"\xff" * 100):
        (tmp_path / "f.safetensors").write_bytes(content)
        for load in (storage.load_tensors, storage.map_tensors):
            with pytest.raises(checks.InputError, match=r"f\.safetensors") as caught:
                load(tmp_path / "f.safetensors")
            assert "\n" not in str(caught.value)
    (tmp_path / "a.json").write_text("{")
    with pytest.raises(checks.InputError, match=r"a\.json: not valid JSON"):
        storage.read_json(tmp_path / "a.json")


def test_a_missing_file_is_named(tmp_path):
    for load in (storage.load_tensors, storage.load_table, storage.checksum, storage.load_metadata):
        with pytest.raises(FileNotFoundError, match=r"absent\.x does not exist; run the stage"):
            load(tmp_path / "absent.x")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.txt"
    storage.write_text(path, "old")
    with pytest.raises(RuntimeError), storage.atomic_path(path) as temporary:
        temporary.write_text("half")
        assert path.read_text() == "old"
        raise RuntimeError
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_full_disk_is_an_os_error_and_leaves_nothing(tmp_path, monkeypatch):
    def full(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match=r"No space left on device.*a\.safetensors"):
        storage.save_tensors(tmp_path / "a.safetensors", ARRAYS, {})
    assert os.listdir(tmp_path) == []


def test_folders_and_devices_are_not_replaced(tmp_path):
    for path in (tmp_path, "/dev/null"):
        with pytest.raises(checks.InputError, match="is not a regular file"):
            storage.write_text(path, "x")


def test_a_link_is_followed(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "target")
    storage.write_text(tmp_path / "link", "x")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "x"


def test_files_get_the_usual_permissions(tmp_path):
    storage.write_text(tmp_path / "a.txt", "x")
    (tmp_path / "b.txt").touch()
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


def test_a_mean_over_nothing_is_null_in_json_and_infinity_is_an_error(tmp_path):
    nothing = float("nan")
    storage.write_json(tmp_path / "a.json", {"a": nothing, "b": [1.5, (nothing,)], "c": {"d": nothing}, "e": "nan"})
    assert storage.read_json(tmp_path / "a.json") == {"a": None, "b": [1.5, [None]], "c": {"d": None}, "e": "nan"}
    with pytest.raises(ValueError, match="JSON"):
        storage.write_json(tmp_path / "b.json", {"a": float("inf")})


def test_metadata_must_be_json(tmp_path):
    with pytest.raises(ValueError, match="JSON"):
        storage.save_tensors(tmp_path / "a.safetensors", {}, {"loss": float("nan")})
    with pytest.raises(TypeError):
        storage.save_tensors(tmp_path / "a.safetensors", {}, {"object": object()})
    assert os.listdir(tmp_path) == []


def test_checksum_of_a_folder_sees_names_and_contents(tmp_path):
    def make(name: str, files: dict[str, str]) -> str:
        for file, text in files.items():
            (tmp_path / name / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name / file).write_text(text)
        return storage.checksum(tmp_path / name)

    first = make("a", {"x": "1", "d/y": "2"})
    assert make("b", {"d/y": "2", "x": "1"}) == first
    assert len({first, make("c", {"x": "2", "d/y": "1"}), make("d", {"x": "1", "y": "2"}), make("e", {"x": "1"})}) == 4

"""The table of switches that `make ablate-options` turns: against configs/cpu.yaml, without training anything."""

import dataclasses
from pathlib import Path

import pytest

from bench.reconstruction import si3dr_options
from ddf.core import checks
from ddf.data import shapenet
from ddf.data.batches import category_data

BASE = si3dr_options.Settings.of("base", 0)


def _flat(value, prefix=""):
    if not isinstance(value, dict):
        return {prefix: value}
    return {key: leaf for name, inner in value.items() for key, leaf in _flat(inner, f"{prefix}.{name}").items()}


@pytest.mark.parametrize("name", [name for name in si3dr_options.OPTIONS if name != "base"])
def test_every_row_changes_its_keys_and_nothing_else(name):
    before, after = (_flat(dataclasses.asdict(each)) for each in (BASE, si3dr_options.Settings.of(name, 0)))
    changed = {key.lstrip(".") for key in before.keys() | after.keys() if before.get(key) != after.get(key)}
    # a section that is left out takes its keys with it
    whole = {key for key in si3dr_options.OPTIONS[name] for each in changed if f"{each}.".startswith(f"{key}.")}
    assert whole == set(si3dr_options.OPTIONS[name])
    assert all(any(f"{each}.".startswith(f"{key}.") for key in whole) for each in changed)
    trains = {key.partition(".")[0] for key in changed} <= {"train", "ddf"}
    assert trains == (name in si3dr_options.TRAINED)


def test_row_that_changes_nothing_is_refused(monkeypatch):
    same = {"train.azimuth": BASE.train.azimuth}
    monkeypatch.setattr(si3dr_options, "OPTIONS", {"same": same})
    with pytest.raises(checks.InputError, match=r"train\.azimuth is sincos already"):
        si3dr_options.Settings.of("same", 0)


def test_seed_is_added_to_all_seeds():
    settings = si3dr_options.Settings.of("base", 3)
    assert settings.train.loop.seed == BASE.train.loop.seed + 3
    assert settings.pointclouds.seed == BASE.pointclouds.seed + 3


def test_validation_shapes_alone_are_scored(monkeypatch):
    monkeypatch.setattr(category_data, "available", lambda _, views: views)
    train, test = shapenet.ShapeEntry("a", (0, 1, 2, 3, 4), ()), shapenet.ShapeEntry("c", (), (0, 1, 2, 3, 4))
    held = shapenet.ShapeEntry("b", (), (), (0, 1, 2, 3, 4))
    dataset = shapenet.Dataset(Path("root"), {"car": shapenet.CategoryEntry("1", (train, held, test))})
    found = si3dr_options.split(si3dr_options.Task("car", 1, 2, 0), dataset)
    assert found == ([("a", (0, 1, 2, 3, 4))], [("b", (0, 1))])
    without = shapenet.Dataset(Path("root"), {"car": shapenet.CategoryEntry("1", (train, test))})
    with pytest.raises(checks.InputError, match=r"dataset\.validation leaves no shape of car"):
        si3dr_options.split(si3dr_options.Task("car", 1, 2, 0), without)


def test_difference_from_base_is_paired_by_shape():
    assert si3dr_options.against_base({"a": 2.0, "b": 4.0}, {"b": 3.0, "a": 1.5}) == "+0.750 ± 0.250"

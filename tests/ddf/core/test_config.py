"""Strict reading of experiment files."""

import dataclasses
from dataclasses import dataclass
from typing import Any, Literal

import pytest
import yaml

from ddf.core import checks, config, schema
from ddf.core.schema import fixed, setting


@dataclass(frozen=True)
class Inner(schema.Checked):
    width: int = setting(2, "pixels", "app. X", least=1)
    rate: float = setting(0.5, "a step")
    seed: int = fixed(0, least=0)


@dataclass(frozen=True)
class Section(schema.Checked):
    faces: int = setting(100, "triangles at most", "app. X", least=4)
    scale: float = setting(1.0, "metres", above=0, below=10, most=9)
    mode: Literal["fast", "exact"] = setting("fast", "how")
    names: tuple[str, ...] = setting((), "who")
    range: tuple[float, float] = setting((0.0, 1.0), "metres")
    inner: Inner = setting(Inner(rate=0.25), "a part")
    other: Inner | None = setting(None, "another; null: none")
    counts: dict[str, int] = setting({"U": 1, "A": 2}, "of each")
    limit: int | None = setting(None, "at most")
    flag: bool = setting(False, "whether")


GOOD: dict[str, Any] = {
    "faces": "10",
    "scale": "1e-4",
    "mode": "fast",
    "names": "[a, b]",
    "range": "[0, 1.5]",
    "inner": "{width: 3}",
    "other": "{rate: 0.75}",
}


def _write(tmp_path, changes: dict[str, str | None], section: str = "meshes"):
    entries = {key: value for key, value in {**GOOD, **changes}.items() if value is not None}
    path = tmp_path / "experiment.yaml"
    path.write_text(f"{section}:\n" + "".join(f"  {key}: {value}\n" for key, value in entries.items()))
    return path


def test_load_gives_typed_values(tmp_path):
    path = _write(tmp_path, {"counts": "{U: 3}", "limit": "null"})
    assert config.load(path, "meshes", Section) == Section(
        faces=10,
        scale=1e-4,
        mode="fast",
        names=("a", "b"),
        range=(0.0, 1.5),
        inner=Inner(3, 0.25),
        other=Inner(2, 0.75),
        counts={"U": 3},
    )
    assert isinstance(config.load(path, "meshes", Section).range[0], float)


@pytest.mark.parametrize(
    ("text", "value"),
    [(t, 1e-4) for t in ("1e-4", "1E-04", "+1e-4", ".1e-3", "0.0001")]
    + [(t, t) for t in ("1:30", "1:30.5", "1_000", "2020-01-31", "yes", "off", "=")]
    + [("010", 10), ("0o10", 8), ("0x1F", 31), ("-.inf", -float("inf")), ("5.", 5.0), ("~", None), ("", None)],
)
def test_words_and_numbers_are_those_of_yaml_1_2(text, value):
    found = config.parse_value(text, "here")
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"face": "3"},
            r"experiment.yaml: meshes: unknown key 'face'; the keys are faces, scale.*\(did you mean faces\?\)",
        ),
        ({"other": "{seed: 3}"}, r"meshes.other: unknown key 'seed'; the keys are width, rate"),
        ({"other": "{width: 0}"}, r"experiment.yaml: meshes.other: width must be >= 1; got 0"),
        ({"faces": "3"}, r"experiment.yaml: meshes: faces must be >= 4; got 3"),
        ({"scale": "10.0"}, r"scale must be <= 9; got 10"),
        ({"faces": "true"}, r"meshes.faces must be of type int; got True"),
        ({"faces": "null"}, r"meshes.faces must be of type int; got None"),
        ({"scale": ".nan"}, r"meshes.scale must be finite; got nan"),
        ({"flag": "1"}, r"meshes.flag must be of type bool; got 1"),
        ({"mode": "slow"}, r"meshes.mode must be one of fast, exact; got 'slow'"),
        ({"names": "a"}, r"meshes.names must be a list; got 'a'"),
        ({"range": "[1]"}, r"meshes.range must have 2 entries; got 1"),
        ({"inner": "3"}, r"meshes.inner must be a mapping of keys to values; got 3"),
        ({"counts": "{U: a}"}, r"meshes.counts.U must be of type int; got 'a'"),
    ],
)
def test_load_refuses_what_does_not_fit(tmp_path, changes, message):
    with pytest.raises(checks.InputError, match=message):
        config.load(_write(tmp_path, changes), "meshes", Section)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "must hold sections"),
        ("meshes: {a: 1", "not valid YAML"),
        ("samples: {a: 1}", "section 'meshes' is missing"),
        ("meshes: {faces: 1, faces: 2}", "not valid YAML.*'faces' is given twice"),
        ("meshes: !!python/object/apply:os.getcwd []", "not valid YAML"),
        ("? [1, 2]\n: 3", "not valid YAML: a key must be one word"),
        ("meshes: {faces: !!timestamp 2020-99-99}", "not valid YAML: month"),
        ("meshes: " + "9" * 5000, "not valid YAML"),
        ("meshes: 0x" + "f" * 16, "over 64 bits"),
        ("meshes: " + "[" * 5000, "lists within lists"),
        ("a: &a [1]\nb: [*a, *a]", "write out what an alias names"),
        ("#" * 200_001, "more than 200,000 bytes"),
        ("meshes: " + "x" * 9000, "meshes must be a mapping"),
    ],
)
def test_read_refuses_other_files(tmp_path, text, message):
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(checks.InputError, match=message) as caught:
        config.load(path, "meshes", Section)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500
    assert "bad.yaml" in str(caught.value)


def test_binary_and_missing_files_are_named(tmp_path):
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x01")
    for name, error in (("binary.yaml", checks.InputError), ("absent.yaml", FileNotFoundError)):
        with pytest.raises(error, match=name):
            config.layers(tmp_path / name)


def _file(folder, name, text):
    (folder / f"{name}.yaml").write_text(text)
    return folder / f"{name}.yaml"


def test_a_file_says_what_differs_from_the_one_below_it(tmp_path):
    _file(tmp_path, "root", "meshes: {faces: 10, inner: {width: 7}, counts: {U: 5}, other: {rate: 0.1}}\nfit:\n")
    _file(tmp_path, "middle", "base: root\nmeshes: {inner: {}, counts: {A: 6}}\n")
    top = _file(tmp_path, "top", "base: middle\nmeshes: {other: {width: 9}}\n")
    found = config.load(top, "meshes", Section)  # parts are merged, mappings replaced
    assert found == Section(10, inner=Inner(7, 0.25), other=Inner(9, 0.1), counts={"A": 6})
    bare = _file(tmp_path, "bare", "base: top\nmeshes: {other: null}\n")
    assert config.load(bare, "meshes", Section).other is None
    assert list(config.layers(top)) == ["meshes", "fit"]
    with pytest.raises(checks.InputError, match=r"top\.yaml: section 'train' is missing"):
        config.load(top, "train", Section)


@pytest.mark.parametrize("base", ["absent", "mine", "[a]"])
def test_a_base_that_is_not_there_and_a_ring_are_named(tmp_path, base):
    _file(tmp_path, "ring", "base: mine\n")
    for name in (base, "ring"):
        path = _file(tmp_path, "mine", f"base: {name}\n")
        with pytest.raises(checks.InputError, match=r"\.yaml: base: there is no other file .* to build on"):
            config.layers(path)


def test_a_section_written_whole_is_read_the_same(tmp_path):
    section = Section(inner=Inner(5, 0.25, seed=3), names=("a",), counts={"O": 1})
    plain = config.plain(section)
    assert plain["inner"] == {"width": 5, "rate": 0.25} and plain["names"] == ["a"] and plain["other"] is None
    path = _file(tmp_path, "whole", yaml.safe_dump({"meshes": plain}))
    assert config.load(path, "meshes", Section) == dataclasses.replace(section, inner=Inner(5, 0.25))


def test_a_record_is_read_without_the_keys_that_are_gone_and_with_those_that_no_file_gives():
    record = {"faces": 7, "gone": 1, "inner": {"width": 3, "rate": 0.5, "seed": 4, "gone": {}}, "other": None}
    assert config.recorded(record, Section, "here") == Section(7, inner=Inner(3, 0.5, 4))
    with pytest.raises(checks.InputError, match=r"here\.inner\.seed must be of type int; got 'x'"):
        config.recorded({"inner": {"seed": "x"}}, Section, "here")
    with pytest.raises(checks.InputError, match="here: faces must be >= 4; got 1"):
        config.recorded({"faces": 1}, Section, "here")

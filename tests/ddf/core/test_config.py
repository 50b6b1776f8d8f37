"""Strict reading of experiment files."""

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Literal

import pytest

from ddf.core import checks, config


@dataclass(frozen=True)
class Inner:
    width: int
    rate: float = 0.5


@dataclass(frozen=True)
class Section:
    faces: int
    scale: float
    mode: Literal["fast", "exact"]
    names: tuple[str, ...]
    range: tuple[float, float]
    inner: Inner
    counts: dict[str, int] = field(default_factory=dict)
    limit: int | None = None
    flag: bool = False

    def __post_init__(self) -> None:
        if self.faces < 4:
            raise checks.InputError(f"meshes.faces must be >= 4; got {self.faces}")


GOOD: dict[str, Any] = {
    "faces": "10",
    "scale": "1e-4",
    "mode": "fast",
    "names": "[a, b]",
    "range": "[0, 1.5]",
    "inner": "{width: 3}",
}


def _write(tmp_path, changes: dict[str, str | None], section: str = "meshes"):
    entries = {key: value for key, value in {**GOOD, **changes}.items() if value is not None}
    path = tmp_path / "experiment.yaml"
    path.write_text(f"{section}:\n" + "".join(f"  {key}: {value}\n" for key, value in entries.items()))
    return path


def test_load_gives_typed_values(tmp_path):
    path = _write(tmp_path, {"counts": "{U: 3}", "limit": "null"})
    assert config.load(path, "meshes", Section) == Section(
        faces=10, scale=1e-4, mode="fast", names=("a", "b"), range=(0.0, 1.5), inner=Inner(3, 0.5), counts={"U": 3}
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
        ({"face": "3"}, r"experiment.yaml: meshes: unknown key 'face'; the keys are faces, scale"),
        ({"scale": None}, r"experiment.yaml: meshes: key 'scale' is missing"),
        ({"faces": "3"}, r"experiment.yaml: meshes.faces must be >= 4; got 3"),
        ({"faces": "3.0"}, r"meshes.faces must be of type int; got 3.0"),
        ({"faces": "true"}, r"meshes.faces must be of type int; got True"),
        ({"faces": "'7'"}, r"meshes.faces must be of type int; got '7'"),
        ({"faces": "null"}, r"meshes.faces must be of type int; got None"),
        ({"scale": ".nan"}, r"meshes.scale must be finite; got nan"),
        ({"scale": "-.inf"}, r"meshes.scale must be finite; got -inf"),
        ({"scale": "fast"}, r"meshes.scale must be of type float; got 'fast'"),
        ({"flag": "1"}, r"meshes.flag must be of type bool; got 1"),
        ({"mode": "slow"}, r"meshes.mode must be one of fast, exact; got 'slow'"),
        ({"names": "a"}, r"meshes.names must be a list; got 'a'"),
        ({"names": "[a, 3]"}, r"meshes.names\[1\] must be of type str; got 3"),
        ({"range": "[1]"}, r"meshes.range must have 2 entries; got 1"),
        ({"inner": "3"}, r"meshes.inner must be a mapping of keys to values; got 3"),
        ({"inner": "{width: 3, depth: 2}"}, r"meshes.inner: unknown key 'depth'"),
        ({"limit": "x"}, r"meshes.limit must be of type int; got 'x'"),
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
        ("- 1", "must hold sections"),
        ("meshes: {a: 1", "not valid YAML"),
        ("samples: {a: 1}", "section 'meshes' is missing"),
        ("meshes: {faces: 1, faces: 2}", "not valid YAML.*'faces' is given twice"),
        ("meshes: 3", "meshes must be a mapping"),
        ("meshes: !!python/object/apply:os.getcwd []", "not valid YAML"),
        ("? [1, 2]\n: 3", "not valid YAML: a key must be one word"),
        ("meshes: {faces: !!timestamp 2020-99-99}", "not valid YAML: month"),
        ("meshes: " + "9" * 5000, "not valid YAML"),
        ("meshes: 0x" + "f" * 16, "over 64 bits"),
        ("meshes: " + "[" * 5000, "lists within lists"),
        ("a: &a [*a]", "an alias stands in what it names"),
        (
            "a: &a [1]\n" + "".join(f"{b}: &{b} [{', '.join([f'*{a}'] * 9)}]\n" for a, b in pairwise("abcdef")),
            "entries",
        ),
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


def test_read_refuses_binary_files_and_names_missing_ones(tmp_path):
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(checks.InputError, match=r"binary.yaml"):
        config.read(tmp_path / "binary.yaml")
    with pytest.raises(FileNotFoundError, match=r"absent\.yaml"):
        config.read(tmp_path / "absent.yaml")

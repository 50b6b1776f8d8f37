"""The stage graph of pipeline.yaml for one experiment: an item per stage, category and seed."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from ddf.core import checks
from ddf_lab.engine import experiments

PIPELINE = Path("pipeline.yaml")


@dataclass(frozen=True)
class Item:
    """One run of a stage. together: how many items of such stages run side by side; None: as many as jobs."""

    stage: str
    key: str  # cpu-chair-1
    command: str
    sections: Mapping[str, tuple[str, ...]]  # by experiment file
    deps: tuple[str, ...]
    outs: tuple[str, ...]
    category: str = ""
    seed: int = 0
    together: int | None = 1
    nice: int = 0
    experiment: str = ""

    @property
    def name(self) -> str:
        """What DVC calls it."""
        return f"{self.stage}@{self.key}"

    @property
    def script(self) -> Path:
        """The stage's script."""
        return Path(f"stages/{self.stage}.py")

    @property
    def data(self) -> tuple[str, ...]:
        """What it depends on besides code."""
        return tuple(dep for dep in self.deps if not dep.startswith(("src/", "stages/")))

    def follows(self, other: "Item") -> bool:
        """Whether it reads what the other makes."""
        return any(_overlap(dep, out) for dep in self.data for out in other.outs)


def load(path: Path = PIPELINE) -> dict[str, dict[str, Any]]:
    """The stages of pipeline.yaml as written; InputError where there is no such file."""
    if not path.is_file():
        raise checks.InputError(f"{path} is not here; experiments run in the folder of the repository that holds it")
    return yaml.safe_load(path.read_text(encoding="utf-8"))["stages"]


def expand(lists: experiments.Lists, path: Path = PIPELINE) -> list[Item]:
    """All items of the lists, in the order of the file."""
    return [
        make_item(stage, entry["do"], key, values)
        for stage, entry in load(path).items()
        for key, values in lists[entry["foreach"].strip("${}")].items()
    ]


def make_item(stage: str, entry: Mapping[str, Any], key: str, values: Mapping[str, str]) -> Item:
    """One item of a stage: its entry with `${item.<name>}` filled in."""
    filled = _fill(entry, values)
    meta = filled.get("meta", {})
    together = meta.get("together", 1)
    return Item(
        stage=stage,
        key=key,
        command=filled["cmd"],
        sections={file: tuple(names) for params in filled["params"] for file, names in params.items()},
        deps=tuple(_paths(filled["deps"])),
        outs=tuple(_paths(filled["outs"])),
        category=values["category"],
        seed=int(values["folder"].rpartition("/")[2] or 0),
        together=None if together == "jobs" else int(together),
        nice=int(meta.get("nice", 0)),
        experiment=values["name"],
    )


def needed(items: Iterable[Item], stages: Iterable[str]) -> list[Item]:
    """The items of some stages and all that these read, directly or not, in order."""
    items, stages = list(items), set(stages)
    kept: list[Item] = []
    for each in reversed(items):
        if each.stage in stages or any(other.follows(each) for other in kept):
            kept.append(each)
    return kept[::-1]


def affected(items: Iterable[Item], names: Iterable[str]) -> list[Item]:
    """The named items and all that read what they make, in order."""
    names, found = set(names), []
    for each in items:
        if each.name in names or any(each.follows(other) for other in found):
            found.append(each)
    return found


def _overlap(one: str, other: str) -> bool:
    return one == other or one.startswith(f"{other}/") or other.startswith(f"{one}/")


def _paths(entries: Iterable[str | dict[str, Any]]) -> list[str]:
    return [next(iter(entry)) if isinstance(entry, dict) else entry for entry in entries]


def _fill(value: Any, item: Mapping[str, str]) -> Any:
    if isinstance(value, dict):
        return {_fill(key, item): _fill(inner, item) for key, inner in value.items()}
    if isinstance(value, list):
        return [_fill(inner, item) for inner in value]
    return re.sub(r"\$\{item\.(\w+)\}", lambda match: item[match[1]], value) if isinstance(value, str) else value

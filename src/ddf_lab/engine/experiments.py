"""Experiments: found in configs/, taken from any other place, or varied by `section.key=value`.

Nothing lists them: every file in configs/ is one. A file that is not there, and a variant, is written to a folder of
its own, artifacts/<name>/<name>.yaml, which git ignores.
"""

import dataclasses
import hashlib
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import yaml

from ddf.core import checks, config, names, storage
from ddf_lab.run import Run

CONFIGS = Path("configs")
NAME = re.compile(r"\w+")
HASH_DIGITS = 8

Lists = dict[str, dict[str, dict[str, str]]]


Kind = Literal["reconstruction", "shape", "generative", "figures"]
DATA = ("dataset", "meshes", "samples")
KINDS: dict[Kind, tuple[str, ...]] = {  # by the sections that a file must have
    "reconstruction": (*DATA, "train", "ddf", "pcsiren", "pointclouds", "evaluate", "report", "export"),
    "shape": ("fit",),
    "generative": (*DATA, "vae", "gan", "scores"),
    "figures": ("figures",),
}
LAST_STAGE: dict[Kind, str] = {
    "reconstruction": "report",
    "shape": "report_shape",
    "generative": "report_generative",
    "figures": "figures",
}
LISTS: dict[str, tuple[tuple[Kind, ...], bool, bool]] = {  # of pipeline.yaml: kinds; by category; with further seeds
    "sources": (("reconstruction", "generative"), False, False),
    "sets": (("reconstruction", "generative"), True, False),
    "experiments": (("reconstruction",), False, False),
    "tasks": (("reconstruction",), True, False),
    "runs": (("reconstruction",), True, True),
    "evaluations": (("reconstruction",), False, True),
    "shapes": (("shape",), False, False),
    "generations": (("generative",), True, False),
    "figures": (("figures",), False, False),
}


@dataclass(frozen=True)
class Experiment:
    """An experiment file in its place. categories: the longest trainings first; none in one of a single shape."""

    file: Path
    categories: tuple[str, ...]
    kind: Kind = "reconstruction"
    base: str = ""  # name of the experiment that this one varies

    @property
    def name(self) -> str:
        """Of its folder in artifacts/."""
        return self.file.stem

    @property
    def last_stage(self) -> str:
        """The one that writes its page."""
        return LAST_STAGE[self.kind]

    def lists(self, seeds: int = 1) -> Lists:
        """What pipeline.yaml makes its items of: the stages of this experiment, and those of further seeds."""
        found: Lists = {}
        for name, (kinds, by_category, seeded) in LISTS.items():
            categories = self.categories if by_category else ("",)
            numbers = range(seeds if seeded else 1) if self.kind in kinds else ()
            items = [item(self.file, category, seed) for seed in numbers for category in categories]
            found[name] = {_key(each): each for each in items}
        return found


def item(file: Path, category: str = "", seed: int = 0) -> dict[str, str]:
    """What stands in pipeline.yaml for `item`: of seed 1, option is " --seed 1" and folder "_seeds/1"."""
    return {
        "file": file.as_posix(),
        "name": file.stem,
        "category": category,
        "option": f" --seed {seed}" if seed else "",
        "folder": f"_seeds/{seed}" if seed else "",
    }


def _key(item: dict[str, str]) -> str:
    """cpu, cpu-chair, cpu-chair-1."""
    parts = (item["name"], item["category"], item["folder"].rpartition("/")[2])
    return "-".join(part for part in parts if part)


def find(given: str, changes: Sequence[str] = ()) -> Experiment:
    """The experiment of a file or a name, with `changes` applied.

    Args:
      given: `configs/cpu.yaml`, `cpu` for short, or any other file of that kind.
      changes: each `section.key=value`, the key as deep as need be, the value as in YAML.
    Raises:
      InputError: there is no such file, its name is another's, or a key is unknown.
    """
    file = _existing(given)
    sections = dict(Run.read(file).given)
    taken = file.parent != CONFIGS and (CONFIGS / file.name).exists()
    if taken or not NAME.fullmatch(file.stem):
        why = f"{CONFIGS / file.name} has it" if taken else "letters, digits and _ only"
        raise checks.InputError(f"{given}: {file.stem!r} cannot be an experiment's name ({why}); rename the file")
    if file.parent != CONFIGS:
        file = _write(file.stem, sections, f"{given}")
    if not changes:
        return read(Run.read(file))
    changed = dict(_change(sections, change) for change in changes)
    digest = hashlib.sha256(json.dumps(changed, sort_keys=True).encode()).hexdigest()[:HASH_DIGITS]
    variant = _write(f"{file.stem}+{digest}", sections, f"{file} with {' '.join(changes)}")
    return dataclasses.replace(read(Run.read(variant)), base=file.stem)


def read(run: Run) -> Experiment:
    """The experiment of a file, wherever that is; InputError where a section is missing."""
    file, sections = run.file, run.given
    for kind in ("shape", "figures"):
        if tuple(sections) == KINDS[kind]:
            return Experiment(file, (), kind)
    generative = is_generative(sections)
    kind: Kind = "generative" if generative else "reconstruction"
    for name in KINDS[kind]:
        if name not in sections:
            like = "generative" if generative else "cpu"
            raise checks.InputError(f"{file}: section {name!r} is missing; give it as configs/{like}.yaml does")
    try:
        categories = tuple(sections["dataset"]["categories"])
    except (KeyError, TypeError) as error:
        raise checks.InputError(f"{file}: dataset.categories is missing or wrong") from error
    for name in categories:  # it stands in commands that a shell runs
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise checks.InputError(f"{file}: dataset.categories: {name!r} is no category (letters, digits and _ only)")
    if generative and len(categories) != 1:
        raise checks.InputError(f"{file}: the models are of one category; dataset.categories has {list(categories)}")
    return Experiment(file, categories, kind)


def is_generative(sections: Iterable[str]) -> bool:
    """Whether an experiment with these sections is one of generative models."""
    return not set(sections).isdisjoint(set(KINDS["generative"]) - set(DATA))


def _existing(given: str) -> Path:
    found = next((path for path in (Path(given), CONFIGS / f"{given}.yaml") if path.is_file()), None)
    if found is None:
        there = names.known(given, sorted(path.stem for path in CONFIGS.glob("*.yaml")))
        raise checks.InputError(f"{given}: no such experiment file; those in {CONFIGS}/ are {there}")
    inside = found.resolve().parent == CONFIGS.resolve()
    return CONFIGS / found.name if inside else found


def _change(sections: dict[str, Any], change: str) -> tuple[str, Any]:
    """Set one key of the sections; the key and its new value."""
    path, equals, text = change.partition("=")
    *parents, last = path.split(".")
    if not equals or not parents:
        raise checks.InputError(f"--set {change}: give section.key=value, such as pcsiren.steps=100")
    place: Any = sections
    for i, name in enumerate([*parents, last]):
        if not isinstance(place, dict) or name not in place:
            where = ".".join(path.split(".")[:i]) or "the file"
            keys = ", ".join(map(str, place)) if isinstance(place, dict) else "none"
            raise checks.InputError(f"--set {change}: unknown key {name!r}; the keys of {where} are {keys}")
        if i < len(parents):
            place = place[name]
    place[last] = config.parse_value(text, f"--set {change}")
    return path, place[last]


def _write(name: str, sections: dict[str, Any], origin: str) -> Path:
    """The file of an experiment that is not in configs/; one that is there and the same stays as it is."""
    file = Path("artifacts") / name / f"{name}.yaml"
    text = f"# {' '.join(origin.split())}\n{yaml.safe_dump(sections, sort_keys=False, allow_unicode=True)}"
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        storage.write_text(file, text)
    return file

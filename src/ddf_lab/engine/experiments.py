"""Experiments: found in configs/, taken from any other place, or varied by `section.key=value`.

Nothing lists them: every file in configs/ and of the package's is one. What runs is written whole to a folder of its
own, artifacts/<name>/<name>.yaml, which git ignores.
"""

import dataclasses
import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from ddf.core import checks, config, storage
from ddf_lab.run import Kind, Run, class_of, layer

NAME = re.compile(r"\w+")
HASH_DIGITS = 8

Lists = dict[str, dict[str, dict[str, str]]]


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
    """The experiment of a file or a name, with `changes` applied, written whole to artifacts/<name>/<name>.yaml.

    That file holds every setting, so that it changes with what a stage reads, wherever that is given, and with nothing
    else.

    Args:
      given: `configs/cpu.yaml`, `cpu` for short, or any other file of that kind. changes: as `Run.read` takes them.
    Raises:
      InputError: there is no such file, its name is another's, a key is unknown, or a value does not fit.
    """
    found = Run.read(given, changes=changes)
    own = config.named_file(found.name)
    if not NAME.fullmatch(found.name) or (own is not None and own.resolve() != found.file.resolve()):
        why = "letters, digits and _ only" if not NAME.fullmatch(found.name) else f"{own} has it"
        raise checks.InputError(f"{given}: {found.name!r} cannot be an experiment's name ({why}); rename the file")
    sections = {name: config.plain(section) for name, section in found.sections().items()}
    name, base = found.name, ""
    if changes:
        said = json.dumps(sorted(map(layer, changes), key=str), sort_keys=True)
        digest = hashlib.sha256(said.encode()).hexdigest()[:HASH_DIGITS]
        name, base = f"{found.name}+{digest}", found.name
    file = Path("artifacts") / name / f"{name}.yaml"
    text = yaml.safe_dump(sections, sort_keys=False, allow_unicode=True)
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        storage.write_text(file, text)
    return dataclasses.replace(read(found), file=file, base=base)


def read(given: Run) -> Experiment:
    """The experiment of a file, wherever that is."""
    if "dataset" not in given.given:
        return Experiment(given.file, (), given.kind)
    categories = tuple(given.section(class_of("dataset")).categories)
    if given.kind == "generative" and len(categories) != 1:
        raise checks.InputError(
            f"{given.file}: the models are of one category; dataset.categories has {list(categories)}"
        )
    return Experiment(given.file, categories, given.kind)

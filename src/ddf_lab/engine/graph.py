"""Experiments, and the stage graph of pipeline.yaml for one of them: an item per stage, category and seed.

Every file in configs/ and of the package's is an experiment; it is taken from any other place too, and varied by
`section.key=value`. What runs is written whole to a folder of its own, artifacts/<name>/<name>.yaml, which git ignores.
"""

import hashlib
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import Literal

import yaml

from ddf.core import checks, config, storage
from ddf_lab.run import Kind, Run, layer

PIPELINE = Path("pipeline.yaml")


@dataclass(frozen=True)
class Stage:
    """An entry of pipeline.yaml, which says what the keys mean."""

    of: tuple[Kind, ...]
    each: tuple[Literal["category", "seed"], ...]
    command: str
    sections: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    together: int | Literal["jobs"] = 1


@dataclass(frozen=True)
class Item:
    """One run of a stage. file: the experiment's. category: empty where the stage is not repeated for each."""

    stage: str
    entry: Stage
    file: Path
    category: str = ""
    seed: int = 0

    @property
    def name(self) -> str:
        """train_ddf@cpu-chair-1: stage, experiment, category and further seed."""
        parts = (self.file.stem, self.category, str(self.seed or ""))
        return f"{self.stage}@{'-'.join(filter(None, parts))}"

    @property
    def command(self) -> str:
        """What a shell runs."""
        options = (("category", self.category), ("seed", self.seed))
        told = [f"--{name} {value}" for name, value in options if value and name in self.entry.each]
        return " ".join([self.entry.command, f"--config {self.file.as_posix()}", *told])

    @property
    def inputs(self) -> list[str]:
        """Files and folders that it reads, relative to the repository."""
        return self._places(self.entry.inputs)

    @property
    def outputs(self) -> list[str]:
        """Folders that it writes."""
        return self._places(self.entry.outputs)

    def _places(self, names: Iterable[str]) -> list[str]:
        values = {"category": self.category, "seed": f"_seeds/{self.seed}" if self.seed else ""}
        return [f"artifacts/{self.file.stem}/{Template(name).substitute(values)}" for name in names]

    def follows(self, other: "Item") -> bool:
        """Whether it reads what the other makes."""
        return any(
            one == out or one.startswith(f"{out}/") or out.startswith(f"{one}/")
            for one in self.inputs
            for out in other.outputs
        )


def experiment(given: str, changes: Sequence[str] = ()) -> Run:
    """The experiment of a file or a name, with `changes` applied, written whole to artifacts/<name>/<name>.yaml.

    Args:
      given: `configs/cpu.yaml`, `cpu` for short, or any other file of that kind. changes: as `Run.read` takes them.
    Raises:
      InputError: there is no such file, its name is another's, a key is unknown, or a value does not fit.
    """
    found = Run.read(given, changes=changes)
    own = config.named_file(found.name)
    is_word = re.fullmatch(r"\w+", found.name)
    if not is_word or (own is not None and own.resolve() != found.file.resolve()):
        why = f"{own} has it" if is_word else "letters, digits and _ only"
        raise checks.InputError(f"{given}: {found.name!r} cannot be an experiment's name ({why}); rename the file")
    sections = {name: config.plain(section) for name, section in found.sections().items()}
    name, _ = found.name, found.categories  # which are checked
    if changes:
        said = json.dumps(sorted(map(layer, changes), key=str), sort_keys=True)
        name += f"+{hashlib.sha256(said.encode()).hexdigest()[:8]}"
    file = Path("artifacts") / name / f"{name}.yaml"
    write(file, yaml.safe_dump(sections, sort_keys=False, allow_unicode=True))
    return Run.read(file)


def write(path: Path, text: str) -> None:
    """A file that stays untouched where it says the same already."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        storage.write_text(path, text)


def load(path: Path = PIPELINE) -> dict[str, Stage]:
    """The stages in the order of the file."""
    if not path.is_file():
        raise checks.InputError(f"{path} is not here; experiments run in the folder of the repository that holds it")
    stages = config.read_yaml(path)
    if not isinstance(stages, dict):
        raise checks.InputError(f"{path}: must hold stages by name")
    return {name: config.parse(entry, Stage, f"{path}: {name}") for name, entry in stages.items()}


def expand(run: Run, seeds: int = 1, path: Path = PIPELINE) -> list[Item]:
    """The items of an experiment, those of further seeds too, in the order of the file."""
    items: list[Item] = []
    for stage, entry in load(path).items():
        if run.kind in entry.of:
            categories = run.categories if "category" in entry.each else ("",)
            numbers = range(seeds if "seed" in entry.each else 1)
            items += [Item(stage, entry, run.file, each, seed) for seed in numbers for each in categories]
    return items


def find(stage: str, run: Run) -> Item | None:
    """The item of a stage that runs in the repository; None elsewhere, and for any other script."""
    entry = load().get(stage) if PIPELINE.is_file() else None
    return Item(stage, entry, run.file, run.category, run.seed) if entry else None


def needed(items: Sequence[Item], stages: Iterable[str]) -> list[Item]:
    """The items of some stages and all that these read, directly or not, in order."""
    stages, kept = set(stages), list[Item]()
    for each in reversed(items):
        if each.stage in stages or any(other.follows(each) for other in kept):
            kept.append(each)
    return kept[::-1]

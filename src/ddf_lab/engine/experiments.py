"""Experiments: found in configs/, taken from any other place, or varied by `section.key=value`.

Every file in configs/ and of the package's is one. What runs is written whole to a folder of its own,
artifacts/<name>/<name>.yaml, which git ignores.
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


@dataclass(frozen=True)
class Experiment:
    """An experiment file in its place. categories: none in an experiment of a single shape, or of figures."""

    file: Path
    categories: tuple[str, ...]
    kind: Kind = "reconstruction"
    base: str = ""  # name of the experiment that this one varies

    @property
    def name(self) -> str:
        """Of its folder in artifacts/."""
        return self.file.stem

    @property
    def folder(self) -> Path:
        """Where all that it makes goes."""
        return Path("artifacts") / self.name


def find(given: str, changes: Sequence[str] = ()) -> Experiment:
    """The experiment of a file or a name, with `changes` applied, written whole to artifacts/<name>/<name>.yaml.

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
        name, base = f"{found.name}+{hashlib.sha256(said.encode()).hexdigest()[:HASH_DIGITS]}", found.name
    file = Path("artifacts") / name / f"{name}.yaml"
    write(file, yaml.safe_dump(sections, sort_keys=False, allow_unicode=True))
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


def write(path: Path, text: str) -> None:
    """A file that stays untouched where it says the same already."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        storage.write_text(path, text)

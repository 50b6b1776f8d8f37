"""Which benchmarks there are: modules of bench/ and its folders that have a `main`. Found by reading, not importing.

A benchmark that `make bench` leaves out, as it takes long or needs a device, says what makes it: `ON_DEMAND = "make
fit-proof"`.
"""

import ast
from dataclasses import dataclass
from pathlib import Path

from ddf.core import checks

FOLDER = Path(__file__).resolve().parents[1]
NOT_GROUPS = ("lib", "rivals")


@dataclass(frozen=True)
class Entry:
    """A benchmark. group: its folder, "" for bench/ itself. about: the first paragraph of its docstring.

    on_demand: what makes it, where `make bench` does not.
    """

    name: str
    group: str
    about: str
    on_demand: str | None

    @property
    def module(self) -> str:
        """To import it by."""
        return ".".join(filter(None, ("bench", self.group, self.name)))


def entries(folder: Path = FOLDER) -> dict[str, Entry]:
    """All benchmarks by name, in the order of names."""
    files = [*folder.glob("[a-z]*.py"), *folder.glob("*/[a-z]*.py")]
    groups = {file: file.parent.relative_to(folder).as_posix().strip(".") for file in files}
    found = [_entry(file, group) for file, group in groups.items() if group not in NOT_GROUPS]
    return {entry.name: entry for entry in sorted(filter(None, found), key=lambda entry: entry.name)}


def _entry(file: Path, group: str) -> Entry | None:
    """None for a module without a `main`."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    if not any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
        return None
    about = " ".join((ast.get_docstring(tree) or "").partition("\n\n")[0].split())
    return Entry(file.stem, group, about, _constant(tree, "ON_DEMAND"))


def _constant(tree: ast.Module, name: str) -> str | None:
    for node in tree.body:
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == name:
            return ast.literal_eval(node.value)
    return None


def find(name: str) -> Entry:
    """One of them.

    Raises:
      InputError: there is none of this name.
    """
    known = entries()
    if name not in known:
        raise checks.InputError(f"{name}: no such benchmark; there are {', '.join(known)}")
    return known[name]


def chosen(names: list[str]) -> list[Entry]:
    """Those of the names, of which one may be a group's; without names all that `make bench` makes.

    Raises:
      InputError: a name is neither a benchmark's nor a group's.
    """
    known = entries()
    if not names:
        return [entry for entry in known.values() if not entry.on_demand]
    groups = {group: [e for e in known.values() if e.group == group] for group in {e.group for e in known.values()}}
    return [entry for name in names for entry in groups.get(name) or [find(name)]]

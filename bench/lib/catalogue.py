"""Which benchmarks there are: modules of bench/ and its folders that have a `main`. Found by reading, not importing.

A benchmark that `make bench` leaves out, as it takes long or needs a device, says what makes it: `ON_DEMAND = "python
-m bench gpu_check, with a GPU"`.
"""

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ddf.core import checks

FOLDER = Path(__file__).resolve().parents[1]
NOT_BENCHMARKS = ("lib", "rivals")


@dataclass(frozen=True)
class Entry:
    """A benchmark. module: to import it by. about: the first paragraph of its docstring.

    on_demand: what makes it, where `make bench` does not.
    """

    name: str
    module: str
    about: str
    on_demand: str | None


def entries(folder: Path = FOLDER) -> dict[str, Entry]:
    """All benchmarks by name, in the order of names."""
    files = [file for file in folder.rglob("[a-z]*.py") if file.parent.name not in NOT_BENCHMARKS]
    found = (_entry(file, file.relative_to(folder.parent)) for file in files)
    return {entry.name: entry for entry in sorted(filter(None, found), key=lambda entry: entry.name)}


def _entry(file: Path, place: Path) -> Entry | None:
    """None for a module without a `main`."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    if not any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
        return None
    assigned = (node for node in tree.body if isinstance(node, ast.Assign))
    own = (ast.literal_eval(node.value) for node in assigned if ast.unparse(node.targets[0]) == "ON_DEMAND")
    about = " ".join((ast.get_docstring(tree) or "").partition("\n\n")[0].split())
    return Entry(file.stem, ".".join(place.with_suffix("").parts), about, next(own, None))


def chosen(names: Sequence[str]) -> list[Entry]:
    """Those of the names; without names all that `make bench` makes. InputError where there is none of a name."""
    known = entries()
    for name in names:
        if name not in known:
            raise checks.InputError(f"{name}: no such benchmark; there are {', '.join(known)}")
    return [known[name] for name in names] or [entry for entry in known.values() if not entry.on_demand]

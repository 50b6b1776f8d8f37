"""Which benchmarks there are: modules in the folders of bench/ that have a `main`. Found by reading, not importing."""

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ddf.core import checks

FOLDER = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Entry:
    """A benchmark. module: to import it by. file: its code. about: the paragraphs of its docstring."""

    name: str
    module: str
    file: Path
    about: tuple[str, ...]


def entries(folder: Path = FOLDER) -> dict[str, Entry]:
    """All benchmarks by name, in the order of names."""
    found = {}
    for file in sorted(folder.glob("*/*.py"), key=lambda file: file.name):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        if any(isinstance(node, ast.FunctionDef) and node.name == "main" for node in tree.body):
            about = tuple(" ".join(part.split()) for part in (ast.get_docstring(tree) or "").split("\n\n"))
            found[file.stem] = Entry(file.stem, f"bench.{file.parent.name}.{file.stem}", file, about)
    return found


def chosen(names: Sequence[str]) -> list[Entry]:
    """Those of the names. InputError where there is none of a name."""
    known = entries()
    for name in names:
        if name not in known:
            raise checks.InputError(f"{name}: no such benchmark; there are {', '.join(known)}")
    return [known[name] for name in names]

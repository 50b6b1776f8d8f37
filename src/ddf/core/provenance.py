"""What made an artefact: configuration, data and the code that was really used, as one fingerprint.

The code version of a module is a hash over its import closure inside the packages, taken from syntax trees without
docstrings: a comment or a docstring does not make a trained network stale, a changed constant does.
"""

import ast
import dataclasses
import functools
import hashlib
import json
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from ddf.core import storage

SOURCES = Path(__file__).resolve().parents[2]  # the folder that holds the packages
PACKAGE = re.compile(r"ddf(_\w+)?")  # ours: this one, and in a checkout those beside it


Modules = str | ModuleType | Sequence[str | ModuleType]


def fingerprint(section: Any, sources: Iterable[str | Path] = (), module: Modules = ()) -> str:
    """That of a `record`."""
    return record(section, 0, sources, module)["fingerprint"]


def record(section: Any, seed: int, sources: Iterable[str | Path] = (), module: Modules = ()) -> dict[str, Any]:
    """The metadata that every artefact carries, to be merged with its own: fingerprint, seed, source checksums.

    Args:
      section: a dataclass, or a list or dict of dataclasses and plain values.
      sources: files or folders; their contents count in the fingerprint, their places do not.
      module: one or more imported modules of the packages, as names or module objects, whose import closure counts.
    """
    modules = [module] if isinstance(module, str | ModuleType) else module
    used = (sys.modules[each] if isinstance(each, str) else each for each in modules)
    code = _hash_of({file for each in used for file in import_closure(str(each.__file__))})
    sums = {Path(path).as_posix(): storage.checksum(path) for path in sources}
    content = {"config": plain(section), "sources": [*sums.values()], "code": code}
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    return {"fingerprint": digest, "seed": seed, "sources": sums}


def script_version(script: str | Path, without: str) -> str:
    """Code version of a script outside the packages and of all that it imports from them but one room."""
    closure = (file for file in import_closure(script) if not file.is_relative_to(SOURCES / without))
    return _hash_of({*closure, Path(script).resolve()})


def import_closure(script: str | Path) -> list[Path]:
    """`script` (if inside a package) and every file of the packages that it imports, directly or not, sorted.

    Imports inside functions count too. Importing a.b.c runs a/__init__.py and a/b/__init__.py, so these are included.
    """
    found: set[Path] = set()
    waiting = [Path(script).resolve()]
    while waiting:
        file = waiting.pop()
        if file not in found:
            found.add(file)
            waiting += (each for name in imported_modules(file) for each in _package_files(name))
    return sorted(filter(_inside, found))


def imported_modules(file: str | Path, typing: bool = False) -> list[str]:
    """Dotted names of all modules that a Python file imports, anywhere in it (`from a import b` gives a and a.b).

    Args:
      typing: with those under `if TYPE_CHECKING:`, which no run imports.
    """
    read = _read(Path(file), Path(file).stat().st_mtime_ns)
    return sorted(read.imports | read.for_types if typing else read.imports)


class _Read(NamedTuple):
    imports: frozenset[str]
    for_types: frozenset[str]  # under `if TYPE_CHECKING:`
    tree: str  # hash of the syntax tree without docstrings


@functools.cache
def _read(file: Path, _changed: int) -> _Read:
    names: dict[bool, set[str]] = {False: set(), True: set()}  # by whether they are for types
    tree = ast.parse(file.read_text(encoding="utf-8"))
    waiting: list[tuple[ast.AST, bool]] = [(tree, False)]
    while waiting:
        node, typing = waiting.pop()
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            waiting += [*((each, typing) for each in node.orelse), *((each, True) for each in node.body)]
            continue
        waiting += ((each, typing) for each in ast.iter_child_nodes(node))
        if isinstance(node, ast.Import):
            names[typing].update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise ValueError(f"{file}:{node.lineno}: imports must be absolute")
            names[typing] |= {str(node.module), *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if ast.get_docstring(node, clean=False) is not None:
                del node.body[0]
    return _Read(frozenset(names[False]), frozenset(names[True]), hashlib.sha256(ast.dump(tree).encode()).hexdigest())


def _package_files(name: str) -> list[Path]:
    """Files that importing `name` runs, outermost first; empty for other packages, shorter for names in a module."""
    files: list[Path] = []
    base, parts = SOURCES, name.split(".") if PACKAGE.fullmatch(name.partition(".")[0]) else []
    for part in parts:
        base /= part
        found = next((file for file in (base / "__init__.py", base.with_suffix(".py")) if file.is_file()), None)
        files += [found] if found else []
        if found is None or found.name != "__init__.py":
            break
    return files


def _inside(file: Path) -> bool:
    return file.is_relative_to(SOURCES) and bool(PACKAGE.fullmatch(file.relative_to(SOURCES).parts[0]))


def _hash_of(files: Iterable[Path]) -> str:
    """Of their syntax trees, docstrings left out."""
    digest = hashlib.sha256()
    for file in sorted(files):
        place = file.relative_to(SOURCES).as_posix() if _inside(file) else file.name
        digest.update(f"{place}\0{_read(file, file.stat().st_mtime_ns).tree}\n".encode())
    return digest.hexdigest()


def plain(value: Any) -> Any:
    """Dataclasses, paths and tuples as what JSON can hold."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value.as_posix() if isinstance(value, Path) else value

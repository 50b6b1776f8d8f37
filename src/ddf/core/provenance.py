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
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from ddf.core import storage

SOURCES = Path(__file__).resolve().parents[2]  # the folder that holds the packages
PACKAGE = re.compile(r"ddf(_\w+)?")  # ours: this one, and in a checkout those beside it


Modules = str | ModuleType | Sequence[str | ModuleType]


def fingerprint(section: Any, sources: Iterable[str | Path] = (), module: Modules = ()) -> str:
    """Hex digest over a config section, the contents of source files and folders, and a code version; see `record`."""
    return record(section, 0, sources, module)["fingerprint"]


def record(section: Any, seed: int, sources: Iterable[str | Path] = (), module: Modules = ()) -> dict[str, Any]:
    """The metadata that every artefact carries, to be merged with its own: fingerprint, seed, source checksums.

    Args:
      section: a dataclass, or a list or dict of dataclasses and plain values.
      sources: files or folders; their contents count in the fingerprint, their places do not.
      module: one or more modules of the packages, as names or module objects, whose import closure counts.
    """
    modules = [module] if isinstance(module, str | ModuleType) else list(module)
    names = [item if isinstance(item, str) else item.__name__ for item in modules]
    sums = {Path(path).as_posix(): storage.checksum(path) for path in sources}
    content = {"config": _plain(section), "sources": [*sums.values()], "code": code_version(tuple(sorted(names)))}
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    return {"fingerprint": digest, "seed": seed, "sources": sums}


@functools.cache
def code_version(modules: tuple[str, ...]) -> str:
    """Hash of the syntax trees, docstrings left out, of everything the named modules import from the packages."""
    return _hash_of_trees({file for name in modules for file in import_closure(module_file(name))})


def script_version(script: str | Path, without: str) -> str:
    """The same of a script outside the packages and of all that it imports from them but one room."""
    left_out = SOURCES / without
    closure = (file for file in import_closure(script) if not file.is_relative_to(left_out))
    return _hash_of_trees({*closure, Path(script).resolve()})


def import_closure(script: str | Path) -> list[Path]:
    """`script` (if inside a package) and every file of the packages that it imports, directly or not, sorted.

    Imports inside functions count too. Importing a.b.c runs a/__init__.py and a/b/__init__.py, so these are included.
    """
    script = Path(script).resolve()
    found: set[Path] = set()
    waiting = [script]
    while waiting:
        file = waiting.pop()
        if file in found:
            continue
        found.add(file)
        for name in imported_modules(file):
            waiting.extend(_package_files(name))
    return sorted(file for file in found if _inside(file))


def imported_modules(file: str | Path, typing: bool = False) -> list[str]:
    """Dotted names of all modules that a Python file imports, anywhere in it (`from a import b` gives a and a.b).

    Args:
      typing: with those under `if TYPE_CHECKING:`, which no run imports.
    """
    return list(_imported(Path(file), Path(file).stat().st_mtime_ns, typing))


@functools.cache
def _imported(file: Path, _changed: int, typing: bool) -> tuple[str, ...]:
    names: set[str] = set()
    waiting: list[ast.AST] = [ast.parse(file.read_text(encoding="utf-8"))]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            waiting.extend(node.orelse + (node.body if typing else []))
            continue
        waiting.extend(ast.iter_child_nodes(node))
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise ValueError(f"{file}:{node.lineno}: imports must be absolute")
            names.add(node.module or "")
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    return tuple(sorted(names))


def module_file(name: str) -> Path:
    """The file of a module of the package, by its dotted name."""
    files = _package_files(name)
    expected = SOURCES.joinpath(*name.split("."))
    if not files or files[-1] not in (expected.with_suffix(".py"), expected / "__init__.py"):
        raise ValueError(f"{name} is not a module of {SOURCES}")
    return files[-1]


def _package_files(name: str) -> list[Path]:
    """Files that importing `name` runs, outermost first; empty for other packages, shorter for names in a module."""
    parts = name.split(".")
    if not PACKAGE.fullmatch(parts[0]):
        return []
    files: list[Path] = []
    for i in range(len(parts)):
        base = SOURCES.joinpath(*parts[: i + 1])
        if (base / "__init__.py").is_file():
            files.append(base / "__init__.py")
        elif base.with_suffix(".py").is_file():
            files.append(base.with_suffix(".py"))
            break
        else:
            break
    return [file for file in files if file.is_file()]


def _inside(file: Path) -> bool:
    """Whether a file is of one of the packages."""
    return file.is_relative_to(SOURCES) and bool(PACKAGE.fullmatch(file.relative_to(SOURCES).parts[0]))


def _hash_of_trees(files: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for file in sorted(files):
        tree = ast.parse(file.read_text(encoding="utf-8"))
        _strip_docstrings(tree)
        place = file.relative_to(SOURCES) if _inside(file) else Path(file.name)
        digest.update(f"{place.as_posix()}\0{ast.dump(tree)}\n".encode())
    return digest.hexdigest()


def _strip_docstrings(tree: ast.AST) -> None:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                node.body = node.body[1:]


def _plain(value: Any) -> Any:
    """Dataclasses, paths and tuples as what JSON can hold."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value.as_posix() if isinstance(value, Path) else value

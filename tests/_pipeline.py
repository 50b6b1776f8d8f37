"""The stage graph of all experiments in configs/ as tests see it."""

import ast
import dataclasses
import functools
from pathlib import Path

from ddf.core import config, provenance
from ddf_lab import run
from ddf_lab.engine import graph

ROOT = Path(__file__).resolve().parents[1]
PIPELINE = ROOT / "pipeline.yaml"
FILES = sorted(path for folder in (ROOT / "configs", config.PACKAGED) for path in folder.glob("*.yaml"))


def experiment(file: Path) -> run.Run:
    """As the runner sees it, whose folder is the repository."""
    return dataclasses.replace(run.Run.read(file), file=Path("artifacts") / file.stem / file.name)


def expand(seeds: int = 1) -> dict[str, graph.Item]:
    """The items of all experiments with that many seeds, each experiment's in order."""
    found = [item for each in map(experiment, FILES) for item in graph.expand(each, seeds, PIPELINE)]
    return {item.name: item for item in found}


def sections_read(script: Path) -> set[str]:
    """The sections that a script, or what it imports, asks its run for; all of its kind for `run.sections()`."""
    named = {place.rpartition(":")[2]: section for section, place in run.SECTIONS.items()}
    asked = {call for file in [script, *provenance.import_closure(script)] for call in _asked(file)}
    whole = run.KINDS["reconstruction"] if ("run.sections", "") in asked else ()
    return {*whole, *(named[name] for _, name in asked if name)}


@functools.cache
def _asked(file: Path) -> set[tuple[str, str]]:
    """What of `run` a file calls to read sections, and the class that it names."""
    calls = (node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call))
    named = ((ast.unparse(call.func), call) for call in calls if isinstance(call.func, ast.Attribute))
    return {
        (name, ast.unparse(call.args[0]).rpartition(".")[2] if call.args else "")
        for name, call in named
        if name in ("run.sections", "run.section", "run.reseeded")
    }

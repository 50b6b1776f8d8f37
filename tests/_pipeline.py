"""The stage graph of all experiments in configs/ as tests see it."""

import ast
import dataclasses
from pathlib import Path

from ddf.core import provenance
from ddf_lab import run
from ddf_lab.engine import experiments, finished, graph

ROOT = Path(__file__).resolve().parents[1]
PIPELINE = ROOT / "pipeline.yaml"
FILES = sorted((ROOT / "configs").glob("*.yaml"))


def experiment(file: Path) -> experiments.Experiment:
    """As the runner sees it, whose folder is the repository."""
    return dataclasses.replace(experiments.read(run.Run.read(file)), file=Path("configs") / file.name)


EXPERIMENTS = [experiment(file) for file in FILES]


def expand(seeds: int = 1) -> dict[str, graph.Item]:
    """The items of all experiments with that many seeds, each experiment's in order."""
    found = [item for each in EXPERIMENTS for item in graph.expand(each.lists(seeds), PIPELINE)]
    return {item.name: item for item in found}


def code_of(script: Path) -> list[str]:
    """The script and the rooms of both packages that it imports from, directly or not, relative to the repository."""
    closure = (file.relative_to(provenance.SOURCES) for file in provenance.import_closure(script))
    rooms = {"/".join(file.parts[:2]) for file in closure if file.name != "__init__.py"} - {finished.FRAME}
    return [script.relative_to(ROOT).as_posix(), *(f"src/{room}" for room in sorted(rooms))]


def sections_read(script: Path) -> set[str]:
    """The sections that a script, or what it imports, asks its run for; all of its kind for `run.sections()`."""
    named = {place.rpartition(":")[2]: section for section, place in run.SECTIONS.items()}
    sections: set[str] = set()
    for file in [script, *provenance.import_closure(script)]:
        for node in ast.walk(ast.parse(file.read_text())):
            if not isinstance(node, ast.Call):
                continue
            if ast.unparse(node.func) == "run.sections":
                sections.update(experiments.KINDS["reconstruction"])
            if ast.unparse(node.func) in ("run.section", "run.reseeded"):
                sections.add(named[ast.unparse(node.args[0]).rpartition(".")[2]])
    return sections

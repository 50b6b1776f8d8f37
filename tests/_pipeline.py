"""The stage graph of all experiments in configs/ as tests see it."""

import ast
import dataclasses
from pathlib import Path

from ddf.core import config, provenance
from ddf_lab.engine import experiments, finished, graph

ROOT = Path(__file__).resolve().parents[1]
PIPELINE = ROOT / "pipeline.yaml"
FILES = sorted((ROOT / "configs").glob("*.yaml"))


def experiment(file: Path) -> experiments.Experiment:
    """As the runner sees it, whose folder is the repository."""
    return dataclasses.replace(experiments.read(file), file=Path("configs") / file.name)


EXPERIMENTS = [experiment(file) for file in FILES]


def expand(seeds: int = 1) -> dict[str, graph.Item]:
    """The items of all experiments with that many seeds, each experiment's in order."""
    found = [item for each in EXPERIMENTS for item in graph.expand(each.lists(seeds), PIPELINE)]
    return {item.name: item for item in found}


def code_of(script: Path) -> list[str]:
    """The script and the rooms of both packages that it imports from, directly or not, relative to the repository."""
    closure = (file.relative_to(provenance.SOURCES) for file in provenance.import_closure(script))
    rooms = sorted({"/".join(file.parts[:2]) for file in closure if len(file.parts) > 2})
    return [script.relative_to(ROOT).as_posix(), *(f"src/{room}" for room in rooms)]


def sections_read(script: Path) -> set[str]:
    """The config sections that a script gives to config.load(...) as dataclasses; all for config.read and load_all."""
    named = {place.rpartition(":")[2]: section for section, place in config.ALL_SECTIONS.items()}
    sections = set()
    frame = provenance.SOURCES / finished.FRAME
    for file in [script, *provenance.import_closure(script)]:
        if file.is_relative_to(frame):
            continue  # it looks at files as a whole
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("config.read", "config.load_all"):
                sections.update(config.SECTIONS)
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "config.load":
                sections.add(named[ast.unparse(node.args[1]).rpartition(".")[2]])
    return sections

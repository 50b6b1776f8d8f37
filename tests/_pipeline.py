"""The stage graph as tests see it."""

import ast
import re
from pathlib import Path
from typing import Any

import yaml

from ddf.core import config, provenance
from ddf.pipeline import further_seeds

ROOT = Path(__file__).resolve().parents[1]
PIPELINE = ROOT / "pipeline.yaml"


def load() -> dict[str, Any]:
    return yaml.safe_load(PIPELINE.read_text())


def expand(seeds: int = 1) -> dict[str, dict[str, Any]]:
    """Every stage with its items filled in, as `name@key`; of all experiments with that many seeds."""
    data = load()
    lists = dict(data["vars"][0])
    for name in lists["experiments"]:
        for group, items in further_seeds.further(data["vars"][0], name, seeds).items():
            lists[group] = lists[group] | items
    stages = {}
    for name, entry in data["stages"].items():
        items = lists[entry["foreach"].strip("${}")]
        for key in items:
            stages[f"{name}@{key}"] = _fill(entry["do"], items[key] if isinstance(items, dict) else key)
    return stages


def script_of(stage: dict[str, Any]) -> Path:
    found = re.search(r"stages/\w+\.py", stage["cmd"])
    if found is None:
        raise ValueError(f"no stage script in {stage['cmd']!r}")
    return ROOT / found.group()


def code_of(script: Path) -> list[str]:
    """The script and the packages of src/ddf that it imports from, directly or not, relative to the repository."""
    closure = (file.relative_to(provenance.PACKAGE_ROOT) for file in provenance.import_closure(script))
    packages = sorted({file.parts[0] for file in closure if len(file.parts) > 1})
    return [script.relative_to(ROOT).as_posix(), *(f"src/ddf/{name}" for name in packages)]


def sections_read(script: Path) -> set[str]:
    """The config sections of the dataclasses that a script gives to config.load(...), all for config.read(...)."""
    named = {place.rpartition(":")[2]: section for section, place in (config.SECTIONS | config.FIT_SECTIONS).items()}
    sections = set()
    for file in [script, *provenance.import_closure(script)]:
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "config.read":
                sections.update(config.SECTIONS)
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "config.load":
                sections.add(named[ast.unparse(node.args[1]).rpartition(".")[2]])
    return sections


def _fill(value: Any, item: dict[str, Any] | str) -> Any:
    """With the parts of the item in place; an item of a plain list is itself what is filled in."""
    if isinstance(value, dict):
        return {_fill(key, item): _fill(inner, item) for key, inner in value.items()}
    if isinstance(value, list):
        return [_fill(inner, item) for inner in value]
    if isinstance(value, str) and isinstance(item, str):
        return value.replace("${item}", item)
    if isinstance(value, str) and isinstance(item, dict):
        for key, replacement in item.items():
            value = value.replace("${item." + key + "}", str(replacement))
    return value

"""The rooms of the package: who may import whom, where heavy packages live, what training can run without."""

import subprocess
import sys
from pathlib import Path

import pytest

from ddf.core import provenance

# A package imports its own level or lower.
LEVELS = {
    "core": 0,
    "geometry": 1,
    "data": 2,
    "fields": 2,
    "training": 3,
    "shape": 4,
    "reconstruction": 4,
    "generative": 4,
    "evaluation": 5,
    "export": 5,
    "report": 6,
    "pipeline": 7,
    "cli": 8,
    "api": 8,
}
HEAVY = {"open3d", "pymeshlab", "trimesh", "fast_simplification", "rtree"}
# Loading and running a trained model, and training one.
LIGHT_MODULES = [
    "geometry.rays",
    "fields.pddf",
    "fields.losses",
    "fields.rendering",
    "fields.cloud_projection",
    "fields.curvature",
    "training.training_loop",
    "reconstruction.reconstruction_models",
    "reconstruction.training_steps",
    "reconstruction.inference",
    "shape.shape_field",
    "shape.field_diagnostics",
]
LIGHT_PACKAGES = {"torch", "numpy", "safetensors", "jaxtyping", "tqdm"}

ROOT = provenance.PACKAGE_ROOT
FILES = sorted(ROOT.rglob("*.py"))


def _room(file: Path) -> str:
    """`data` for src/ddf/data/synthetic/parts.py, empty for the package's own __init__."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    return "" if parts == ("__init__",) else parts[0]


def _name(file: Path) -> str:
    parts = file.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {_name(file): file for file in FILES}


def _imports_of(file: Path) -> set[str]:
    """The modules of the package that a file imports directly; of the package's own __init__, when it runs."""
    names = provenance.imported_modules(file, typing=bool(_room(file)))
    return {name for name in names if name in NAMES and name != "ddf"}


@pytest.mark.parametrize("file", FILES, ids=_name)
def test_every_package_has_a_level_and_imports_downwards(file):
    if not _room(file):
        assert _imports_of(file) == set()
        return
    assert _room(file) in LEVELS, f"give {_room(file)} a level in tests/test_import_graph.py"
    upwards = [name for name in _imports_of(file) if LEVELS[name.split(".")[1]] > LEVELS[_room(file)]]
    assert upwards == []


def test_no_room_is_too_full():
    assert {_room(file) for file in FILES} - {""} == set(LEVELS)
    for folder in {file.parent for file in FILES}:
        assert len(list(folder.glob("*.py"))) <= 15, folder
    for file in FILES:
        assert len(file.read_text(encoding="utf-8").splitlines()) <= 400, file


def test_there_are_no_import_cycles():
    graph = {name: _imports_of(file) for name, file in NAMES.items()}
    finished: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, " -> ".join([*path[path.index(name) :], name])
        if name not in finished:
            for other in sorted(graph[name]):
                visit(other, (*path, name))
            finished.add(name)

    for name in graph:
        visit(name, ())


@pytest.mark.parametrize("file", FILES, ids=_name)
def test_heavy_geometry_packages_stay_in_geometry_and_data(file):
    heavy = {name.split(".")[0] for name in provenance.imported_modules(file)} & HEAVY
    if heavy:
        assert _room(file) in ("geometry", "data"), heavy


def test_training_and_inference_import_without_other_packages():
    blocked = HEAVY | {"pandas", "scipy", "matplotlib", "joblib", "yaml", "psutil", "dvc", "dask", "distributed"}
    program = f"""
import importlib, importlib.machinery, sys
class Block:
    def find_spec(self, name, path=None, target=None):
        if name in {blocked!r}:
            return importlib.machinery.ModuleSpec(name, self)
    def create_module(self, spec):
        raise ImportError("blocked: " + spec.name)
sys.meta_path.insert(0, Block())
for module in {LIGHT_MODULES!r}:
    importlib.import_module("ddf." + module)
"""
    subprocess.run([sys.executable, "-W", "ignore", "-c", program], check=True, timeout=120)


def test_matplotlib_is_drawn_in_figures_only():
    users = {_name(file) for file in FILES if any("matplotlib" in name for name in provenance.imported_modules(file))}
    assert users <= {"ddf.report.figures"}

"""The rooms of the package: who may import whom, where heavy packages live, and what training can run without."""

import subprocess
import sys
from pathlib import Path

import pytest

from ddf import provenance

# A module imports its own level or lower. `service` modules serve all levels and so import level 0 and each other only.
ROOMS: dict[str, list[str]] = {
    "0": ["rays", "checks", "cameras", "transforms"],
    "service": ["config", "storage", "portions", "provenance", "parallel", "distributed", "stage", "seeding"],
    "1": [
        "primitives",
        "mesh_config",
        "mesh_io",
        "meshes",
        "mesh_shards",
        "raycast",
        "packing",
        "sampling",
        "shape_mesh",
        "sample_shards",
        "clouds",
        "cloud_io",
        "ray_io",
        "neighbours",
        "splits",
        "shapenet",
        "synthetic",
        "dataset",
    ],
    "2": ["siren", "activations", "derivatives", "passes", "fields", "losses", "curvature", "nearest_rays"],
    "3": [
        "refinement",
        "rendering",
        "composition",
        "pointclouds",
        "metrics",
        "reconstruction",
        "silhouettes",
        "si3dr_data",
    ],
    "4": [
        "optimisers",
        "training",
        "si3dr_training",
        "proposed_rays",
        "training_truth",
        "mirrored_data",
        "si3dr_inference",
        "step_cost",
        "step_timing",
        "shape_field",
        "single_shape",
        "shape_diagnostics",
        "paper_ablation",
        "sample_ablation",
        "onnx_outputs",
        "onnx_graphs",
        "onnx_parity",
        "onnx_precision",
        "onnx_export",
        "onnx_models",
        "trained",
    ],
    "edge": [
        "evaluation",
        "baselines",
        "paper_results",
        "seed_items",
        "seed_means",
        "stage_scripts",
        "strips",
        "shape_pictures",
        "shape_views",
        "shape_errors",
        "shape_results",
        "shape_tables",
        "shape_reports",
        "figures",
        "pages",
        "report_charts",
        "report_diagnosis",
        "report_inputs",
        "report_pictures",
        "report_tables",
        "report_texts",
        "reports",
        "experiment_cost",
        "cli",
    ],
}
ORDER = ["0", "service", "1", "2", "3", "4", "edge"]
ROOM_OF = {module: room for room, modules in ROOMS.items() for module in modules}
HEAVY = {"open3d", "pymeshlab", "trimesh", "fast_simplification", "rtree"}
# Loading and running a trained model, and training one.
LIGHT_MODULES = [
    "rays",
    "fields",
    "losses",
    "rendering",
    "pointclouds",
    "reconstruction",
    "training",
    "si3dr_training",
    "si3dr_inference",
    "curvature",
    "shape_field",
    "shape_diagnostics",
]
LIGHT_PACKAGES = {"torch", "torchvision", "numpy", "safetensors", "jaxtyping", "tqdm"}

ROOT = provenance.PACKAGE_ROOT
FILES = sorted(ROOT.rglob("*.py"))


def _top(file: Path) -> str:
    """`meshes` for src/ddf/meshes.py, `cli` for src/ddf/cli/info.py, empty for the package's own __init__."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    return "" if parts == ("__init__",) else parts[0]


def _name(file: Path) -> str:
    parts = file.relative_to(ROOT.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {_name(file): file for file in FILES}


def _imports_of(file: Path) -> set[str]:
    """The modules of the package that a file imports directly."""
    return {name for name in provenance.imported_modules(file) if name in NAMES and name != "ddf"}


@pytest.mark.parametrize("file", FILES, ids=_name)
def test_every_module_has_a_room_and_imports_downwards(file):
    if not _top(file):
        assert _imports_of(file) == set()
        return
    assert _top(file) in ROOM_OF, f"give {_top(file)} a room in tests/test_import_graph.py"
    level = ORDER.index(ROOM_OF[_top(file)])
    upwards = [name for name in _imports_of(file) if ORDER.index(ROOM_OF[name.split(".")[1]]) > level]
    assert upwards == []
    if ROOM_OF[_top(file)] == "service":
        assert {ROOM_OF[name.split(".")[1]] for name in _imports_of(file)} <= {"0", "service"}


def test_rooms_name_real_modules_once():
    modules = [module for room in ROOMS.values() for module in room]
    assert len(modules) == len(set(modules))
    assert set(modules) == {_top(file) for file in FILES} - {""}


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
def test_heavy_geometry_packages_stay_in_level_1(file):
    heavy = {name.split(".")[0] for name in provenance.imported_modules(file)} & HEAVY
    if heavy:
        assert ROOM_OF[_top(file)] == "1", heavy


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
    assert users <= {"ddf.figures"}

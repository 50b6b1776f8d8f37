"""The rooms of both packages: who may import whom, where heavy packages live."""

import graphlib
from pathlib import Path

from ddf.core import provenance

# Every room has a level of its own and imports lower ones alone, so `ddf` never imports `ddf_lab`.
ROOMS = (
    "ddf.core",
    "ddf.geometry",
    "ddf.data",
    "ddf.fields",
    "ddf.metrics",
    "ddf.pictures",
    "ddf.models",
    "ddf.training",
    "ddf.fit",
    "ddf.reconstruction",
    "ddf.io",
    "ddf.api",
    "ddf.torch",
    "ddf.jax",
    "ddf.cli",
    "ddf.__main__",
    "ddf_lab.run",
    "ddf_lab.evaluation",
    "ddf_lab.model_cards",
    "ddf_lab.report",
    "ddf_lab.figures",
    "ddf_lab.engine",
    "ddf_lab.commands",
)
LEVELS = {room: level for level, room in enumerate(ROOMS)}
HEAVY = {"open3d", "pymeshlab", "trimesh", "fast_simplification", "rtree"}
FILES = sorted(file for name in ("ddf", "ddf_lab") for file in (provenance.SOURCES / name).rglob("*.py"))


def _name(file: Path) -> str:
    parts = file.relative_to(provenance.SOURCES).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _room(name: str) -> str:
    """`ddf.data` for ddf.data.synthetic.parts, empty for the packages themselves."""
    return ".".join(name.split(".")[:2]) if "." in name else ""


NAMES = {_name(file): file for file in FILES}


def _imports_of(name: str) -> set[str]:
    """The modules of the packages that a module imports directly; of a package's own __init__, when it runs."""
    names = provenance.imported_modules(NAMES[name], typing=bool(_room(name)))
    return {other for other in names if other in NAMES and _room(other)}


def test_every_room_has_a_level_and_imports_downwards():
    for name in NAMES:
        if not _room(name):
            assert _imports_of(name) == set()
            continue
        assert _room(name) in LEVELS, f"give {_room(name)} a level in tests/test_import_graph.py"
        upwards = [other for other in _imports_of(name) if LEVELS[_room(other)] > LEVELS[_room(name)]]
        assert upwards == [], name


def test_there_are_no_import_cycles():
    graphlib.TopologicalSorter({name: _imports_of(name) for name in NAMES}).prepare()  # or an error that names one


def test_heavy_packages_have_their_rooms():
    for name, file in NAMES.items():
        tops = {imported.split(".")[0] for imported in provenance.imported_modules(file)}
        assert not tops & HEAVY or _room(name) in ("ddf.geometry", "ddf.data"), name
        assert "matplotlib" not in tops or name == "ddf_lab.report.figures", name

"""The trained models and fields that come with the package: `src/ddf/shipped`, a folder each, listed in index.json."""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ddf.core import errors

ROOT = Path(__file__).resolve().parents[1] / "shipped"
INDEX = "index.json"
_MESHES = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".dae", ".3mf", ".ac", ".acc", ".fbx")  # no models


@dataclass(frozen=True)
class ShippedModel:
    """A model: its name, what it is (field, reconstruction, vae), one sentence, its folder, its files with bytes."""

    name: str
    kind: str
    summary: str
    folder: Path
    files: dict[str, int]

    @property
    def num_bytes(self) -> int:
        """Of all its files."""
        return sum(self.files.values())


@cache
def listed(root: Path = ROOT) -> tuple[ShippedModel, ...]:
    """All of them, in the order of the index; none where there is no index."""
    index = root / INDEX
    if not index.is_file():
        return ()
    entries = json.loads(index.read_text(encoding="utf-8"))["models"]
    return tuple(ShippedModel(e["name"], e["kind"], e["summary"], root / e["name"], e["files"]) for e in entries)


def require(name_or_path: str | Path, *kinds: str) -> Path:
    """As `place`, of what is there.

    Args:
      kinds: of the models that are meant, for the complaint.
    """
    path = place(name_or_path)
    if not path.exists():
        there = errors.known_names(name_or_path, [model.name for model in listed() if model.kind in kinds])
        raise FileNotFoundError(f"{path}: no such file or folder, and no {kinds[0]} of that name; there are {there}")
    if path.is_file() and path.suffix.lower() in _MESHES:
        raise errors.InputError(f"{path}: this is a mesh; make a field of it first: ddf fit {path} my_field")
    return path


def place(name_or_path: str | Path) -> Path:
    """The path as it is, or the folder of the model of that name where no such path exists."""
    path = Path(name_or_path)
    if path.exists():
        return path
    return next((model.folder for model in listed() if model.name == str(name_or_path)), path)

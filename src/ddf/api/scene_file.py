"""Scene files: YAML that names fields and says where they stand. docs/formats.md has the keys."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import transform

from ddf.api import field as fields
from ddf.api.scene import Scene
from ddf.core import checks, config
from ddf.fields import scene_field
from ddf.geometry import transforms

SUFFIXES = (".yaml", ".yml")
Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Placement:
    """One object: x -> translation + scale R x of its mesh's frame; R turns about x, then y, then z (fixed axes).

    field: a path from the folder of the scene file, or a name of `ddf models`.
    """

    field: str
    scale: float = 1.0
    rotation_deg: Triple = (0.0, 0.0, 0.0)
    translation: Triple = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not self.scale > 0:
            raise checks.InputError(f"scale must be positive; got {self.scale}")

    def similarity(self) -> transforms.Similarity:
        """From the frame of the mesh to that of the scene."""
        turn = transform.Rotation.from_euler("xyz", self.rotation_deg, degrees=True).as_matrix()
        return transforms.Similarity(self.scale, turn, np.array(self.translation))


@dataclass(frozen=True)
class BoxCorners:
    """A box that rays from outside enter first: what lies before is cut away."""

    lower: Triple
    upper: Triple

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise checks.InputError(f"lower must be below upper on every axis; got {self.lower} and {self.upper}")


@dataclass(frozen=True)
class Waypoint:
    """Where the camera of a flight stands, and what it looks at."""

    position: Triple
    target: Triple

    def look_at(self) -> scene_field.LookAt:
        """As a camera."""
        return scene_field.LookAt(np.array(self.position), np.array(self.target))


@dataclass(frozen=True)
class SceneFile:
    """The content of a scene file. soft: η_T of the paper's soft composition; null for the nearest surface."""

    objects: tuple[Placement, ...]
    up: Literal["y", "z"] = "y"
    box: BoxCorners | None = None
    soft: float | None = None
    fly: tuple[Waypoint, ...] = ()

    def __post_init__(self) -> None:
        if not self.objects:
            raise checks.InputError("objects must list one field or more; got none")
        if self.soft is not None and not self.soft > 0:
            raise checks.InputError(f"soft must be positive, or null; got {self.soft}")
        for waypoint in self.fly:
            waypoint.look_at()


def read(path: str | Path) -> SceneFile:
    """The content of a scene file.

    Raises:
      FileNotFoundError: there is no such file. InputError: it is no YAML, or a key is unknown, missing or out of range.
    """
    return config.parse(config.read_yaml(path), SceneFile, f"{path}: scene")


def build(content: SceneFile, folder: Path) -> Scene:
    """The scene of a file's content; a field that is named several times is loaded once.

    Args:
      folder: that fields are looked for in.
    Raises:
      FileNotFoundError: there is no such field. InputError: as of `ddf.load`.
    """
    loaded = {name: fields.load(place(folder, name)) for name in {placement.field for placement in content.objects}}
    box = None if content.box is None else (np.array(content.box.lower), np.array(content.box.upper))
    blend = None if content.soft is None else scene_field.Blend(content.soft)
    places = [placement.similarity() for placement in content.objects]
    return Scene([loaded[placement.field] for placement in content.objects], places, box, blend)


def read_scene(path: str | Path) -> Scene:
    """The scene of a file that `ddf scene` reads: fields, where they stand, the box, hard or soft.

    Raises:
      FileNotFoundError: there is no such file, or no such field. ValueError: an unknown, missing or wrong key, named.

    Example:
      >>> import ddf, pathlib, tempfile
      >>> file = pathlib.Path(tempfile.mkdtemp(), "scene.yaml")
      >>> _ = file.write_text("objects: [{field: rabbit}, {field: rabbit, translation: [1.5, 0, 0]}]")
      >>> ddf.read_scene(file).render(size=16)["depth"].shape
      (16, 16)
    """
    return build(read(path), Path(path).parent)


def place(folder: Path, name: str) -> Path | str:
    """The file or folder beside the scene file; the name where there is none."""
    return folder / name if (folder / name).exists() else name

"""Several fields in one scene, asked as one field; scene files, YAML whose keys docs/formats.md has."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from jaxtyping import Float
from scipy.spatial import transform

from ddf.api import queries
from ddf.api.field import Field, load
from ddf.core import checks, config, shipped_models
from ddf.fields import scene_field
from ddf.geometry import transforms as frames

Box = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]
Triple = tuple[float, float, float]


class Scene(queries.Queried):
    """Several fields, each where it stands; what is asked and answered is in the frame of the scene."""

    def __init__(
        self,
        fields: Sequence[Field],
        scene_from_mesh: Sequence[frames.Similarity],
        box: Box | None = None,
        blend: scene_field.Blend | None = None,
        up: Literal["y", "z"] = "y",
    ) -> None:
        corners = np.concatenate([to.apply(field.corners) for field, to in zip(fields, scene_from_mesh, strict=True)])
        lower, upper = (corners.min(axis=0), corners.max(axis=0)) if box is None else box
        framed = tuple(field.framed for field in fields)
        super().__init__(scene_field.SceneField(framed, tuple(scene_from_mesh), lower, upper, blend))
        self._fields, self._places, self.up = tuple(fields), tuple(scene_from_mesh), up

    def udf(self, positions: npt.ArrayLike) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
        """Unsigned distances to the nearest surface of the scene, and the directions of the closest point.

        The least of the distances of the fields (`Field.udf`); one whose box is farther than a surface is not asked.

        Args:
          positions: (n, 3), anywhere, in the frame of the scene.
        Returns:
          Distances (n) and unit directions (n, 3), 0 where the distance is 0.
        Raises:
          ValueError: a shape that is not (n, 3), a value that is not finite, or a field in which nothing is seen.
        """
        asked = queries.require_points("positions", positions)
        asks = [field.udf for field in self._fields]
        found = scene_field.closest([field.framed for field in self._fields], asks, self._places, asked)
        return found.distances, found.directions


def compose(fields: Sequence[Field], transforms: Sequence[Any], soft: float | None = None) -> Scene:
    """Several fields as one scene. Source: [DDF22] §4.1; depth and normals are those of the nearest visible field.

    Args:
      fields: one or more, the same one as often as you like.
      transforms: for each field a 4x4 matrix from the frame of its mesh to that of the scene: a scaling of all axes
        alike, a rotation and a translation.
      soft: the paper's temperature η_T, in one over the unit of the scene, instead of the nearest: depth and all else
        are then means over the fields, weighted by visibility and inverse depth.
    Returns:
      The scene: `query`, `render`, `udf`, `box` and `outputs` as of a field.
    Raises:
      ValueError: no field, another number of transforms, a matrix that shears or mirrors, or a temperature that is not
        positive.

    Example:
      >>> import ddf, numpy as np
      >>> rabbit, beside = ddf.load("rabbit"), np.eye(4)
      >>> beside[0, 3] = 1.5
      >>> scene = ddf.compose([rabbit, rabbit], [np.eye(4), beside])
      >>> depth = scene.query([[0, 0.45, 5], [1.5, 0.45, 5]], [[0, 0, -1]] * 2)["depth"]
      >>> bool(np.isclose(*depth, atol=1e-4))
      True
    """
    if not all(isinstance(each, Field) for each in fields):
        raise checks.InputError("a scene is made of fields, such as ddf.load gives")
    if not fields or len(fields) != len(transforms):
        raise checks.InputError(f"a scene needs fields and a transform for each; got {len(fields)}, {len(transforms)}")
    if soft is not None and not 0 < soft < float("inf"):
        raise checks.InputError(f"soft must be positive and finite, or None; got {soft}")
    places = [
        each if isinstance(each, frames.Similarity) else frames.Similarity.of_matrix("a transform", each)
        for each in transforms
    ]
    return Scene(fields, places, blend=None if soft is None else scene_field.Blend(soft))


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
        _require_near(*self.translation)
        self.similarity()

    def similarity(self) -> frames.Similarity:
        """From the frame of the mesh to that of the scene."""
        turn = transform.Rotation.from_euler("xyz", self.rotation_deg, degrees=True).as_matrix()
        return frames.Similarity(self.scale, turn, np.array(self.translation))


@dataclass(frozen=True)
class BoxCorners:
    """A box that rays from outside enter first: what lies before is cut away."""

    lower: Triple
    upper: Triple

    def __post_init__(self) -> None:
        _require_near(*self.lower, *self.upper)
        if not all(low < high for low, high in zip(self.lower, self.upper, strict=True)):
            raise checks.InputError(f"lower must be below upper on every axis; got {self.lower} and {self.upper}")


@dataclass(frozen=True)
class Waypoint:
    """Where the camera of a flight stands, and what it looks at."""

    position: Triple
    target: Triple

    def __post_init__(self) -> None:
        _require_near(*self.position, *self.target)
        self.look_at()

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
        self.blend()

    def blend(self) -> scene_field.Blend | None:
        """The soft composition, if there is one."""
        return None if self.soft is None else scene_field.Blend(self.soft)


def _require_near(*numbers: float) -> None:
    if max(map(abs, numbers)) > queries.FARTHEST:
        raise checks.InputError(f"numbers must be within {queries.FARTHEST:g}; got {numbers}")


def read_content(path: str | Path) -> SceneFile:
    """The content of a scene file."""
    return config.parse(config.read_yaml(path), SceneFile, f"{path}: scene")


def build(content: SceneFile, path: Path) -> Scene:
    """The scene of a file's content; a field that is named several times is loaded once. Errors name the file."""
    loaded = {}
    for name in dict.fromkeys(placement.field for placement in content.objects):
        try:
            loaded[name] = load(field_beside(path.parent, name))
        except (checks.InputError, FileNotFoundError) as error:
            raise checks.InputError(f"{path}: scene.objects: field {name!r}: {error}") from error
    box = None if content.box is None else (np.array(content.box.lower), np.array(content.box.upper))
    places = [placement.similarity() for placement in content.objects]
    return Scene([loaded[placement.field] for placement in content.objects], places, box, content.blend(), content.up)


def read_scene(path: str | Path) -> Scene:
    """The scene of a file that `ddf render` draws: fields, where they stand, the box, hard or soft.

    Raises:
      FileNotFoundError: there is no such file. ValueError: an unknown, missing or wrong key, or no such field, named.

    Example:
      >>> import ddf, pathlib, tempfile
      >>> file = pathlib.Path(tempfile.mkdtemp(), "scene.yaml")
      >>> _ = file.write_text("objects: [{field: rabbit}, {field: rabbit, translation: [1.5, 0, 0]}]")
      >>> ddf.read_scene(file).render(size=16)["depth"].shape
      (16, 16)
    """
    return build(read_content(path), Path(path))


def field_beside(folder: Path, name: str) -> Path:
    """The file or folder beside the scene file; where there is none, the model of that name."""
    beside, known = folder / name, {model.name: model.folder for model in shipped_models.listed()}
    return beside if beside.exists() else known.get(name, beside)

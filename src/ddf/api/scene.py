"""Several fields in one scene, asked as one field."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.api import inputs, queries
from ddf.api.field import Field
from ddf.core import checks
from ddf.fields import composition, framed_field
from ddf.geometry import rays, transforms

# The soft depth of `composition` is not used here: any values will do.
_TEMPERATURE, _INVERSE_DEPTH = 1.0, 1.0


@dataclass(frozen=True)
class SceneField:
    """Fields and where they stand: a `framed_field.FramedField` whose frame is that of the scene."""

    fields: tuple[framed_field.FramedField, ...]
    scene_from_mesh: tuple[transforms.Similarity, ...]
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]

    @property
    def field_from_mesh(self) -> transforms.Similarity:
        """The scene has one frame."""
        return transforms.Similarity()

    @property
    def outputs(self) -> tuple[str, ...]:
        """What every field knows."""
        return tuple(name for name in self.fields[0].outputs if all(name in field.outputs for field in self.fields))

    @property
    def scalar(self) -> Float[np.ndarray, ""]:
        """Cameras are computed by numpy."""
        return np.zeros(())

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Visibility and depth of `composition.compose`, with the hard choice; the rest is of the field chosen."""
        placed = [self._placed(field, place) for field, place in zip(self.fields, self.scene_from_mesh, strict=True)]
        found = composition.compose(placed, positions, directions, _TEMPERATURE, _INVERSE_DEPTH)
        answers = {"visibility": found.visibility, "depth": found.nearest_depth}
        others = [name for name in outputs if name not in answers]
        for index in range(len(self.fields) if others else 0):
            chosen = found.nearest == index
            for name, values in self._ask(index, positions[chosen], directions[chosen], others).items():
                answers.setdefault(name, np.zeros((len(positions), *values.shape[1:])))[chosen] = values
        return {name: answers[name] for name in outputs}

    def _ask(
        self,
        index: int,
        positions: Float[np.ndarray, "n 3"],
        directions: Float[np.ndarray, "n 3"],
        outputs: Collection[str],
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs of one field, in the frame of the scene."""
        mesh_from_scene = self.scene_from_mesh[index].inverse()
        points = rays.OrientedPoints(mesh_from_scene.apply(positions), mesh_from_scene.apply_directions(directions))
        found, _ = framed_field.query(self.fields[index], points, outputs)
        return framed_field.in_mesh_frame(found, mesh_from_scene)

    @staticmethod
    def _placed(field: framed_field.FramedField, scene_from_mesh: transforms.Similarity) -> composition.Placed:
        def query(
            positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
        ) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
            found = field.evaluate(positions, directions, ("visibility", "depth"))
            return found["visibility"], found["depth"]

        field_from_scene = field.field_from_mesh.compose(scene_from_mesh.inverse())
        return composition.Placed(query, field_from_scene, tuple(field.lower.tolist()), tuple(field.upper.tolist()))


class Scene(queries.Queried):
    """Several fields, each where it stands; what is asked and answered is in the frame of the scene."""


def compose(fields: Sequence[Field], transforms: Sequence[Any]) -> Scene:
    """Several fields as one scene. Source: [DDF22] §4.1; depth and normals are those of the nearest visible field.

    Args:
      fields: one or more, the same one as often as you like.
      transforms: for each field a 4x4 matrix from the frame of its mesh to that of the scene: a scaling of all axes
        alike, a rotation and a translation.
    Returns:
      The scene: `query`, `render`, `udf`, `box` and `outputs` as of a field.
    Raises:
      ValueError: no field, another number of transforms, or a matrix that shears or mirrors.

    Example:
      >>> import ddf, numpy as np
      >>> rabbit, beside = ddf.load("rabbit"), np.eye(4)
      >>> beside[0, 3] = 1.5
      >>> scene = ddf.compose([rabbit, rabbit], [np.eye(4), beside])
      >>> depth = scene.query([[0, 0.45, 5], [1.5, 0.45, 5]], [[0, 0, -1]] * 2)["depth"]
      >>> bool(np.isclose(*depth, atol=1e-4))
      True
    """
    if not fields or len(fields) != len(transforms):
        raise checks.InputError(f"a scene needs fields and a transform for each; got {len(fields)}, {len(transforms)}")
    places = tuple(inputs.similarity(matrix) for matrix in transforms)
    corners = np.concatenate([place.apply(field.corners) for field, place in zip(fields, places, strict=True)])
    framed = tuple(field.framed for field in fields)
    return Scene(SceneField(framed, places, corners.min(axis=0), corners.max(axis=0)))

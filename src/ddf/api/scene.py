"""Several fields in one scene, asked as one field."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from jaxtyping import Float

from ddf.api import inputs, queries
from ddf.api.field import Field
from ddf.core import checks
from ddf.fields import scene_field
from ddf.geometry import transforms as frames

Box = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]


class Scene(queries.Queried):
    """Several fields, each where it stands; what is asked and answered is in the frame of the scene."""

    def __init__(
        self,
        fields: Sequence[Field],
        scene_from_mesh: Sequence[frames.Similarity],
        box: Box | None = None,
        blend: scene_field.Blend | None = None,
    ) -> None:
        corners = np.concatenate([to.apply(field.corners) for field, to in zip(fields, scene_from_mesh, strict=True)])
        lower, upper = (corners.min(axis=0), corners.max(axis=0)) if box is None else box
        framed = tuple(field.framed for field in fields)
        super().__init__(scene_field.SceneField(framed, tuple(scene_from_mesh), lower, upper, blend))
        self._fields, self._places = tuple(fields), tuple(scene_from_mesh)

    def udf(self, positions: npt.ArrayLike) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
        """Unsigned distances to the nearest surface of the scene, and the directions of the closest point.

        The least of the distances of the fields (`Field.udf`); one whose box is farther than a surface is not asked.

        Args:
          positions: (n, 3), anywhere, in the frame of the scene.
        Returns:
          Distances (n) and unit directions (n, 3), 0 where the distance is 0.
        Raises:
          ValueError: a shape that is not (n, 3), a value that is not finite, or a field in which nothing is seen.

        Example:
          >>> import ddf, numpy as np
          >>> above = np.eye(4)
          >>> above[1, 3] = 4.0
          >>> scene = ddf.compose([ddf.load("rabbit")] * 2, [np.eye(4), above])
          >>> distances, directions = scene.udf([[0.0, 2.0, 0.0], [0.0, 6.0, 0.0]])
          >>> bool(np.isclose(*distances)), bool(np.allclose(*directions))
          (True, True)
        """
        asked = inputs.points("positions", positions)
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
    if not fields or len(fields) != len(transforms):
        raise checks.InputError(f"a scene needs fields and a transform for each; got {len(fields)}, {len(transforms)}")
    if soft is not None and not 0 < soft < float("inf"):
        raise checks.InputError(f"soft must be positive and finite, or None; got {soft}")
    places = tuple(inputs.similarity(matrix) for matrix in transforms)
    return Scene(fields, places, blend=None if soft is None else scene_field.Blend(soft))

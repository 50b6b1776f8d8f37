"""Unsigned distances of a scene: UDF = min_k UDF_k, exactly, each in the unit of the scene. [DDF22] Property IV.

The surface of field k lies in its box B_k, so the distance to B_k is a bound from below: a field whose box is farther
than a surface already found is not asked. Where UDF_k = UDF_j the scene has a medial surface of its own.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ddf.fields import framed_field
from ddf.geometry import transforms

# positions (n, 3) of a field's mesh frame -> distances (n) and unit directions of the closest points (n, 3)
Distances = Callable[[Float[np.ndarray, "n 3"]], tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]]


@dataclass(frozen=True)
class Nearest:
    """Distances and unit directions v*, scene frame, and for how many points fields were asked, all together."""

    distances: Float[np.ndarray, "n"]
    directions: Float[np.ndarray, "n 3"]
    queries: int


def nearest(
    fields: Sequence[framed_field.FramedField],
    asks: Sequence[Distances],
    scene_from_mesh: Sequence[transforms.Similarity],
    positions: Float[np.ndarray, "n 3"],
) -> Nearest:
    """UDF and v* of the scene; of each point the fields are asked in the order of their boxes' distances.

    Args:
      asks: UDF_k and v*_k of every field, in the frame of its mesh.
    """
    inner = [place.inverse() for place in scene_from_mesh]
    bounds = np.stack(
        [_box_distance(field, back.apply(positions)) / back.scale for field, back in zip(fields, inner, strict=True)]
    )
    order = np.argsort(bounds, axis=0, kind="stable")
    distances, directions, queries = np.full(len(positions), np.inf), np.zeros(positions.shape), 0
    for rank in range(len(fields)):
        turn = order[rank]
        open_still = bounds[turn, np.arange(len(positions))] < distances
        for index in np.unique(turn[open_still]):
            asked = np.flatnonzero(open_still & (turn == index))
            queries += len(asked)
            found, ways = asks[index](inner[index].apply(positions[asked]))
            found = found / inner[index].scale
            nearer = found < distances[asked]
            distances[asked[nearer]] = found[nearer]
            directions[asked[nearer]] = scene_from_mesh[index].apply_directions(ways[nearer])
    return Nearest(distances, directions, queries)


def _box_distance(field: framed_field.FramedField, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """Distance from points of the mesh frame to the field's box, mesh unit; 0 inside."""
    inside = field.field_from_mesh.apply(positions)
    beyond = np.maximum(np.maximum(field.lower - inside, inside - field.upper), 0.0)
    return np.linalg.norm(beyond, axis=-1) / field.field_from_mesh.scale

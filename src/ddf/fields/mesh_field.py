"""A mesh asked as a field is, by rays cast at it: a truth is drawn and measured by what draws and measures fields."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ddf.fields import framed_field
from ddf.geometry import mesh_io, raycast, rays, transforms


@dataclass(frozen=True)
class MeshField:
    """A mesh in the box and the frame of a field (`framed_field.FramedField`)."""

    scene: raycast.Scene
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    field_from_mesh: transforms.Similarity

    outputs = ("visibility", "depth", "normals")

    @property
    def scalar(self) -> Float[np.ndarray, ""]:
        """Cameras are computed by numpy."""
        return np.zeros(())

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs, field frame, float64; 0 on a miss."""
        back = self.field_from_mesh.inverse()
        asked = rays.OrientedPoints(back.apply(positions), back.apply_directions(directions))
        hits = raycast.cast(self.scene, asked)
        found = {
            "visibility": hits.visible.astype(np.float64),
            "depth": self.field_from_mesh.scale_depth(np.where(hits.visible, hits.depth, 0.0)),
            "normals": self.field_from_mesh.apply_directions(hits.normals),
        }
        return {name: found[name] for name in outputs}


def beside(field: framed_field.FramedField, mesh: mesh_io.Mesh) -> MeshField:
    """The mesh that a field was fitted to, in that field's box and frame."""
    return MeshField(raycast.Scene(mesh), field.lower, field.upper, field.field_from_mesh)

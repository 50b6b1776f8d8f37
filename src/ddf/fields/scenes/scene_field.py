"""Several fields and where they stand, asked as one field: every output of the composite, hard or soft.

Hard: visibility is the largest of the fields, at least 1/2 exactly where there is a depth; all else is of the nearest
field that is visible, which alone is asked for it. Soft, with the weights a_k of `composition`: depth is Σ a_k d_k, and
every other output the same mean, of normals the unit vector along it (derived here; the paper composes visibility and
depth alone). As η_T goes to 0 its depth is the hard one.
"""

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ddf.fields import field_outputs, framed_field
from ddf.fields.scenes import composition
from ddf.geometry import rays, transforms

_LEAST_WEIGHT = 1e-3  # a field with less of the soft mean is not asked for what is neither visibility nor depth


@dataclass(frozen=True)
class Blend:
    """How soft the composition is. temperature: η_T. inverse_depth: ε_s. Both in units of the scene."""

    temperature: float
    inverse_depth: float = 0.05


_ANY = Blend(1.0)  # the hard choice reads none of it


@dataclass(frozen=True)
class SceneField:
    """Fields and where they stand: a `framed_field.FramedField` whose frame is that of the scene.

    lower, upper: of a box that rays from outside enter first; they begin there. blend: None for the hard choice.
    cull: whether a field is asked for visibility and depth of the rays that meet its box alone, `composition.compose`.
    """

    fields: tuple[framed_field.FramedField, ...]
    scene_from_mesh: tuple[transforms.Similarity, ...]
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    blend: Blend | None = None
    cull: bool = True

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
        """Named outputs of the composite, scene frame and unit; a field is asked for the rays that meet its box."""
        placed = [_placed(field, place) for field, place in self._members()]
        blend = self.blend or _ANY
        found = composition.compose(placed, positions, directions, blend.temperature, blend.inverse_depth, self.cull)
        depth = found.nearest_depth if self.blend is None else found.depth
        answers = {"visibility": found.visibility if self.blend else found.nearest_visibility, "depth": depth}
        others = [name for name in outputs if name not in answers]
        for index, (field, place) in enumerate(self._members() if others else ()):
            weight = found.weights[index] if self.blend else (found.nearest == index).astype(np.float64)
            chosen = weight > _LEAST_WEIGHT
            for name, values in _ask(field, place, positions[chosen], directions[chosen], others).items():
                whole = answers.setdefault(name, np.zeros((len(positions), *values.shape[1:])))
                whole[chosen] += weight[chosen].reshape(-1, *[1] * (values.ndim - 1)) * values
        for name in (name for name in others if field_outputs.OUTPUTS[name].kind == "directions"):
            length = np.linalg.norm(answers[name], axis=-1, keepdims=True)
            answers[name] = answers[name] / np.where(length > 0, length, 1.0)
        return {name: answers[name] for name in outputs}

    def _members(self) -> Iterator[tuple[framed_field.FramedField, transforms.Similarity]]:
        return zip(self.fields, self.scene_from_mesh, strict=True)


def _ask(
    field: framed_field.FramedField,
    scene_from_mesh: transforms.Similarity,
    positions: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "n 3"],
    outputs: Collection[str],
) -> dict[str, Float[np.ndarray, "n ..."]]:
    """Named outputs of one field, in the frame of the scene."""
    mesh_from_scene = scene_from_mesh.inverse()
    points = rays.OrientedPoints(mesh_from_scene.apply(positions), mesh_from_scene.apply_directions(directions))
    found, _ = framed_field.query(field, points, outputs)
    return framed_field.in_mesh_frame(found, mesh_from_scene)


def _placed(field: framed_field.FramedField, scene_from_mesh: transforms.Similarity) -> composition.Placed:
    def query(
        positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
        found = field.evaluate(positions, directions, ("visibility", "depth"))
        return found["visibility"], found["depth"]

    field_from_scene = field.field_from_mesh.compose(scene_from_mesh.inverse())
    return composition.Placed(query, field_from_scene, tuple(field.lower.tolist()), tuple(field.upper.tolist()))


@dataclass
class Counted:
    """A field that counts what it is asked for. queries: oriented points so far, once for every call they are in."""

    field: framed_field.FramedField
    queries: int = 0

    @property
    def lower(self) -> Float[np.ndarray, "3"]:
        """Of the field."""
        return self.field.lower

    @property
    def upper(self) -> Float[np.ndarray, "3"]:
        """Of the field."""
        return self.field.upper

    @property
    def field_from_mesh(self) -> transforms.Similarity:
        """Of the field."""
        return self.field.field_from_mesh

    @property
    def outputs(self) -> tuple[str, ...]:
        """Of the field."""
        return self.field.outputs

    @property
    def scalar(self) -> Any:
        """Of the field."""
        return self.field.scalar

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """As the field."""
        self.queries += len(positions)
        return self.field.evaluate(positions, directions, outputs)

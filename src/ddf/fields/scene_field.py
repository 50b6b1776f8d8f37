"""Several fields and where they stand, asked as one field: outputs, distances, and the cameras that look at them.

Hard: all is of the nearest field that is visible, which alone is asked for more than visibility and depth; where none
is, visibility is the largest, below 1/2. Fields are asked in the order in which a ray enters their boxes, and not once
it has met a surface before the next box. Soft ([DDF22] §4.1), with ξ_k, d_k what field k says of the oriented point in
its own frame, depths in units of the scene,

  ξ = 1 - Π_k (1 - ξ_k),   a = softmax_k( ξ_k / (η_T (ε_s + d_k)) ),   d = Σ_k a_k d_k,

and every other output is the same mean, of normals the unit vector along it (derived here; the paper composes
visibility and depth alone). As η_T goes to 0 the depth is the hard one. Surfaces at depths d < e mix unless η_T is well
below 1/(ε_s + d) - 1/(ε_s + e): far scenes need a small one. From outside its box B_k a ray enters that first, the way
there is part of d_k, and a field whose box the ray misses takes no part (the paper is silent).

Unsigned distances are exact: UDF = min_k UDF_k, each in the unit of the scene ([DDF22] Property IV). The surface of
field k lies in its box B_k, so the distance to B_k is a bound from below: a field whose box is farther than a surface
already found is not asked. Where UDF_k = UDF_j the scene has a medial surface of its own.

A camera has a position and looks at a target ([DDF22] fig. `simpleroom`); its lens is that of `cameras`. Everything is
in the frame of the scene.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.fields import field_outputs, framed_field
from ddf.geometry import cameras, rays, transforms

_SMALLEST = float(np.finfo(np.float64).tiny)  # its inverse is still finite
_MOST_PAIRS, _ROUNDING = 2**22, 1e-12  # rays times fields at once; of squared distances
_LEAST_WEIGHT = 1e-3  # a field with less of the soft mean is not asked for what is neither visibility nor depth

# visibility and depth by name; for all else the fields, each with rows and their weights
_Found = tuple[dict[str, np.ndarray], Iterable[tuple[int, np.ndarray, np.ndarray]]]


@dataclass(frozen=True)
class Blend:
    """How soft the composition is. temperature: η_T. inverse_depth: ε_s, unit of the scene. The paper gives neither."""

    temperature: float
    inverse_depth: float = 0.05

    def __post_init__(self) -> None:
        for name in ("temperature", "inverse_depth"):
            if not _SMALLEST <= (value := getattr(self, name)) < float("inf"):
                raise checks.InputError(f"{name} must be positive and finite; got {value}")


@dataclass(frozen=True)
class SceneField:
    """Fields and where they stand: a `framed_field.FramedField` whose frame is that of the scene.

    lower, upper: of a box that rays from outside enter first; they begin there. blend: None for the hard choice.
    """

    fields: tuple[framed_field.FramedField, ...]
    scene_from_mesh: tuple[transforms.Similarity, ...]
    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]
    blend: Blend | None = None

    @property
    def field_from_mesh(self) -> transforms.Similarity:
        """The scene has one frame."""
        return transforms.Similarity()

    @property
    def outputs(self) -> tuple[str, ...]:
        """What every field knows."""
        return tuple(name for name in self.fields[0].outputs if all(name in field.outputs for field in self.fields))

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """Named outputs of the composite, scene frame and unit; a field is asked for the rays that meet its box."""
        most = max(1, _MOST_PAIRS // len(self.fields))
        if len(positions) > most:
            starts = range(0, len(positions), most)
            parts = [self.evaluate(positions[i : i + most], directions[i : i + most], outputs) for i in starts]
            return {name: np.concatenate([part[name] for part in parts]) for name in outputs}
        find = self._nearest if self.blend is None else self._mean
        answers, shares = find(positions, directions)
        others = [name for name in outputs if name not in answers]
        for index, chosen, weight in shares if others else ():
            for name, values in _ask(*self._member(index), positions[chosen], directions[chosen], others).items():
                whole = answers.setdefault(name, np.zeros((len(positions), *values.shape[1:])))
                whole[chosen] += weight.reshape(-1, *[1] * (values.ndim - 1)) * values
        for name in (name for name in others if field_outputs.OUTPUTS[name].kind == "directions"):
            length = np.linalg.norm(answers[name], axis=-1, keepdims=True)
            answers[name] = answers[name] / np.where(length > 0, length, 1.0)
        return {name: answers[name] for name in outputs}

    def _nearest(self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> _Found:
        """By the hard choice."""
        visibility, depth = np.zeros(len(positions)), np.full(len(positions), np.inf)
        first = np.zeros(len(positions), int)
        for index, asked in _in_turn(self._entries(positions, directions), depth):
            seen, far = _meet(*self._member(index), positions[asked], directions[asked])
            nearer = (seen >= framed_field.SEEN) & (far < depth[asked])
            nothing = np.isinf(depth[asked])
            visibility[asked[nothing]] = np.maximum(visibility[asked], seen)[nothing]
            visibility[asked[nearer]] = seen[nearer]
            depth[asked[nearer]], first[asked[nearer]] = far[nearer], index
        met = np.flatnonzero(np.isfinite(depth))
        shares = ((index, rows, np.ones(len(rows))) for index, rows in _grouped(first, met))
        return {"visibility": visibility, "depth": depth}, shares

    def _mean(self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> _Found:
        """By the soft one."""
        assert self.blend
        met = [_meet(*self._member(index), positions, directions) for index in range(len(self.fields))]
        visibilities, depths = (np.stack(values) for values in zip(*met, strict=True))
        answers, weights = compose(visibilities, depths, self.blend)
        chosen = [np.flatnonzero(weight > _LEAST_WEIGHT) for weight in weights]
        return answers, ((i, rows, weights[i, rows]) for i, rows in enumerate(chosen))

    def _entries(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> Float[np.ndarray, "k n"]:
        """How far a ray goes before it enters each field's box; `inf` where it misses that, or the ball around it."""
        boxes = [(field.field_from_mesh.compose(place.inverse()), field) for field, place in self._members()]
        middle = np.stack([to.inverse().apply((each.lower + each.upper) / 2) for to, each in boxes])
        reach = np.array([np.linalg.norm(each.upper - each.lower) / 2 / to.scale for to, each in boxes])
        along = middle @ directions.T - (positions * directions).sum(-1)
        far = np.square(middle).sum(-1)[:, None] + np.square(positions).sum(-1)
        near = far * (1 - _ROUNDING) - 2 * middle @ positions.T - along**2 <= reach[:, None] ** 2
        entries = np.full(near.shape, np.inf)
        for entry, rows, (to, each) in zip(entries, near, boxes, strict=True):
            starts, ways = to.apply(positions[rows]), to.apply_directions(directions[rows])
            _, distance, meets = rays.enter_box(starts, ways, each.lower, each.upper)
            entry[rows] = np.where(meets, distance / to.scale, np.inf)
        return entries

    def _member(self, index: int) -> tuple[framed_field.FramedField, transforms.Similarity]:
        return self.fields[index], self.scene_from_mesh[index]

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


def _meet(
    field: framed_field.FramedField,
    scene_from_mesh: transforms.Similarity,
    positions: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "n 3"],
) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """ξ_k and d_k, unit of the scene; 0 and `inf` of rays that miss the field's box, for which it is not asked."""
    field_from_scene = field.field_from_mesh.compose(scene_from_mesh.inverse())
    looking = field_from_scene.apply_directions(directions)
    entry, distance, meets = rays.enter_box(field_from_scene.apply(positions), looking, field.lower, field.upper)
    found = field.evaluate(entry[meets], looking[meets], ("visibility", "depth"))
    visibility, depth = np.zeros_like(distance), np.full_like(distance, np.inf)
    visibility[meets] = found["visibility"]
    depth[meets] = (found["depth"] + distance[meets]) / field_from_scene.scale
    return visibility, depth


def _grouped(of: Int[np.ndarray, "n"], rows: Int[np.ndarray, "_"]) -> Iterator[tuple[int, Int[np.ndarray, "_"]]]:
    """Each field of some rows, with those of its own; of no rows, the first with none."""
    ordered = rows[np.argsort(of[rows], kind="stable")]
    for part in np.split(ordered, np.flatnonzero(np.diff(of[ordered])) + 1):
        yield int(of[part[0]]) if len(part) else 0, part


def _in_turn(
    bounds: Float[np.ndarray, "k n"], best: Float[np.ndarray, "n"]
) -> Iterator[tuple[int, Int[np.ndarray, "_"]]]:
    """Fields, nearest bound first, each with the rows that it may still be the best of; the caller lowers `best`."""
    for turn in np.argsort(bounds, axis=0, kind="stable"):
        rows = np.flatnonzero(bounds[turn, np.arange(len(best))] < best)
        if not len(rows):
            return
        yield from _grouped(turn, rows)


def compose(
    visibilities: Float[np.ndarray, "k n"], depths: Float[np.ndarray, "k n"], blend: Blend
) -> tuple[dict[str, Float[np.ndarray, "n"]], Float[np.ndarray, "k n"]]:
    """Soft visibility and depth of a scene (`inf` where nothing is), and the weight of each field in other outputs.

    Args:
      depths: unit of the scene; `inf` where a field takes no part.
    """
    near = np.isfinite(depths)
    some, finite = near.any(axis=0), np.where(near, depths, 0.0)
    score = np.where(near, visibilities / (blend.inverse_depth + finite), -np.inf)
    # the largest is taken off before the division by η_T: none overflows
    power = np.exp((score - np.where(some, score.max(axis=0), 0.0)) / blend.temperature)
    weights = power / np.where(some, power.sum(axis=0), 1.0)
    depth = np.where(some, (weights * finite).sum(axis=0), np.inf)
    return {"visibility": 1 - (1 - visibilities).prod(axis=0), "depth": depth}, weights


class Counted:
    """A field that counts what it is asked for. queries: oriented points so far, once for every call they are in."""

    def __init__(self, field: framed_field.FramedField) -> None:
        self.field, self.queries = field, 0
        self.lower, self.upper, self.field_from_mesh = field.lower, field.upper, field.field_from_mesh
        self.outputs, self.scalar = field.outputs, getattr(field, "scalar", np.zeros(()))

    def evaluate(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], outputs: Collection[str]
    ) -> dict[str, Float[np.ndarray, "n ..."]]:
        """What the field says, counted."""
        self.queries += len(positions)
        return self.field.evaluate(positions, directions, outputs)


# positions (n, 3) of a field's mesh frame -> distances (n) and unit directions of the closest points (n, 3)
Distances = Callable[[Float[np.ndarray, "n 3"]], tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]]


@dataclass(frozen=True)
class Nearest:
    """Distances and unit directions v*, scene frame, and for how many points fields were asked, all together."""

    distances: Float[np.ndarray, "n"]
    directions: Float[np.ndarray, "n 3"]
    queries: int


def closest(
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
    distances, directions, queries = np.full(len(positions), np.inf), np.zeros(positions.shape), 0
    for index, asked in _in_turn(bounds, distances):
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


_UPRIGHT = 1e-6  # |up x way| below this: the camera looks straight up or down


@dataclass(frozen=True)
class LookAt:
    """A camera at `position` that looks at `target`; InputError where the two coincide, or a number is not finite."""

    position: Float[np.ndarray, "3"]
    target: Float[np.ndarray, "3"]

    def __post_init__(self) -> None:
        checks.require_finite("a camera", np.stack([self.position, self.target]))
        if not np.linalg.norm(self.target - self.position) > 0:
            raise checks.InputError(f"a camera must look away from where it stands; got {self.position.tolist()} twice")

    def rays(self, size: int, up: str = "y") -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]:
        """Starts and unit directions through the pixel centres of a picture, rows from the top."""
        backwards = self.position - self.target
        backwards = backwards / np.linalg.norm(backwards)
        above = framed_field.upright(up)[:, 1]
        right = np.cross(above, backwards)
        if np.linalg.norm(right) < _UPRIGHT:
            right = np.cross(np.roll(above, 1), backwards)
        right = right / np.linalg.norm(right)
        rows = np.stack([right, np.cross(backwards, right), backwards])
        directions = cameras.pixel_directions(size, np.zeros(0)).reshape(-1, 3) @ rows
        return np.broadcast_to(self.position, directions.shape).copy(), directions


def one(field: framed_field.FramedField, azimuth_deg: float, elevation_deg: float, radius: float, up: str) -> LookAt:
    """The camera of `framed_field.camera_rays`, of a field whose frame is the scene's."""
    starts, _ = framed_field.camera_rays(field, (azimuth_deg, elevation_deg, radius), 1, up)
    return LookAt(starts[0], (field.lower + field.upper) / 2)


def orbit(
    field: framed_field.FramedField,
    azimuth_deg: float,
    elevation_deg: float,
    radius: float | None,
    frames: int,
    up: str,
) -> list[LookAt]:
    """Once around the box, evenly; without a radius the box stays within every picture."""
    turns = [azimuth_deg + 360.0 * i / frames for i in range(frames)]
    if radius is None:
        radius = max(framed_field.framing_radius(field, turn, elevation_deg, up) for turn in turns)
    return [one(field, turn, elevation_deg, radius, up) for turn in turns]


def fly(waypoints: Sequence[LookAt], frames: int) -> list[LookAt]:
    """Along two waypoints or more, positions and targets linear between two, as many frames between every two."""
    if len(waypoints) < 2:
        raise checks.InputError(f"a flight needs two waypoints or more; got {len(waypoints)}")
    stops = np.arange(len(waypoints))
    places = np.linspace(0, len(waypoints) - 1, frames)
    parts = [np.stack([getattr(w, name) for w in waypoints]) for name in ("position", "target")]
    positions, targets = (np.stack([np.interp(places, stops, column) for column in part.T], axis=-1) for part in parts)
    return [LookAt(position, target) for position, target in zip(positions, targets, strict=True)]


def straight_in(field: framed_field.FramedField, start: LookAt) -> list[LookAt]:
    """Two waypoints: from a camera to the middle of the box, looking ahead all the way."""
    middle = (field.lower + field.upper) / 2
    ahead = middle + (middle - start.position) / 2
    return [LookAt(start.position, ahead), LookAt(middle, ahead)]

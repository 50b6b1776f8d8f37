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
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.fields import field_outputs, framed_field
from ddf.geometry import cameras, rays, transforms

_SMALLEST = float(np.finfo(np.float64).tiny)  # its inverse is still finite
_MOST_RAYS, _MOST_PAIRS, _ROUNDING = 2**14, 2**21, 1e-12  # at once, of fields and rays too; of squared distances
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
        most = _MOST_RAYS if self.blend is None else max(1, _MOST_PAIRS // len(self.fields))
        if len(positions) > most:
            starts = range(0, len(positions), most)
            parts = [self.evaluate(positions[i : i + most], directions[i : i + most], outputs) for i in starts]
            return {name: np.concatenate([part[name] for part in parts]) for name in outputs}
        find = self._nearest if self.blend is None else self._mean
        answers, shares = find(len(positions), self._placed.met(positions, directions))
        others = [name for name in outputs if name not in answers]
        for index, chosen, weight in shares if others else ():
            for name, values in self._ask(index, positions[chosen], directions[chosen], others).items():
                whole = answers.setdefault(name, np.zeros((len(positions), *values.shape[1:])))
                whole[chosen] += weight.reshape(-1, *[1] * (values.ndim - 1)) * values
        for name in (name for name in others if field_outputs.OUTPUTS[name].kind == "directions"):
            length = np.linalg.norm(answers[name], axis=-1, keepdims=True)
            answers[name] = answers[name] / np.where(length > 0, length, 1.0)
        return {name: answers[name] for name in outputs}

    def _nearest(self, count: int, met: "_Met") -> _Found:
        """By the hard choice, of so many rays."""
        visibility, depth, first = np.zeros(count), np.full(count, np.inf), np.zeros(count, int)
        for turn in met.in_turn():
            turn = turn[met.entry[turn] < depth[met.ray[turn]]]
            if not len(turn):
                break
            seen, far = self._answers(met, turn)
            ray, nothing = met.ray[turn], np.isinf(depth[met.ray[turn]])
            nearer = (seen >= framed_field.SEEN) & (far < depth[ray])
            visibility[ray[nothing]] = np.maximum(visibility[ray], seen)[nothing]
            visibility[ray[nearer]] = seen[nearer]
            depth[ray[nearer]], first[ray[nearer]] = far[nearer], met.member[turn[nearer]]
        shares = ((i, rows, np.ones(len(rows))) for i, rows in _grouped(first, np.flatnonzero(np.isfinite(depth))))
        return {"visibility": visibility, "depth": depth}, shares

    def _mean(self, count: int, met: "_Met") -> _Found:
        """By the soft one."""
        assert self.blend
        visibilities, depths = np.zeros((len(self.fields), count)), np.full((len(self.fields), count), np.inf)
        pairs = met.member, met.ray
        visibilities[pairs], depths[pairs] = self._answers(met, np.arange(len(met.ray)))
        answers, weights = compose(visibilities, depths, self.blend)
        chosen = [np.flatnonzero(weight > _LEAST_WEIGHT) for weight in weights]
        return answers, ((i, rows, weights[i, rows]) for i, rows in enumerate(chosen))

    @cached_property
    def _placed(self) -> "_Placed":
        return _Placed(self.fields, self.scene_from_mesh)

    def _answers(
        self, met: "_Met", pairs: Int[np.ndarray, "p"]
    ) -> tuple[Float[np.ndarray, "p"], Float[np.ndarray, "p"]]:
        """ξ_k and d_k, unit of the scene, of some pairs. A field in several places is asked once for all."""
        visibility, depth, member = np.zeros(len(pairs)), np.zeros(len(pairs)), met.member[pairs]
        for own, rows in _grouped(self._placed.own[member], np.arange(len(pairs))):
            starts, ways = met.starts[pairs[rows]], met.ways[pairs[rows]]
            found = self.fields[own].evaluate(starts, ways, ("visibility", "depth"))
            visibility[rows], depth[rows] = found["visibility"], found["depth"]
        return visibility, depth / self._placed.scale[member] + met.entry[pairs]

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


@dataclass(frozen=True)
class _Met:
    """Pairs of a ray and a member whose box it meets: nearest box first of each ray, ray by ray.

    entry: how far the ray goes before it enters that, unit of the scene. starts, ways: there, frame of the field.
    """

    ray: Int[np.ndarray, "p"]
    member: Int[np.ndarray, "p"]
    entry: Float[np.ndarray, "p"]
    starts: Float[np.ndarray, "p 3"]
    ways: Float[np.ndarray, "p 3"]

    def in_turn(self) -> list[Int[np.ndarray, "_"]]:
        """The first pair of every ray, then the second of those that have one, and so on."""
        begins = np.flatnonzero(np.diff(self.ray, prepend=-1))
        rank = np.arange(len(self.ray)) - np.repeat(begins, np.diff(begins, append=len(self.ray)))
        return np.split(np.argsort(rank, kind="stable"), np.cumsum(np.bincount(rank))[:-1])


class _Placed:
    """Boxes and maps of all members, which rays are held against at once. own: the first member of the same field."""

    def __init__(
        self, fields: Sequence[framed_field.FramedField], scene_from_mesh: Sequence[transforms.Similarity]
    ) -> None:
        inner = (place.inverse() for place in scene_from_mesh)
        maps = [field.field_from_mesh.compose(back) for field, back in zip(fields, inner, strict=True)]
        self.scale = np.array([to.scale for to in maps])
        self.turns = np.stack([to.rotation for to in maps])
        self.moves = np.stack([to.translation for to in maps])
        self.lower, self.upper = (np.array([getattr(each, name) for each in fields]) for name in ("lower", "upper"))
        first = dict[int, int]()
        self.own = np.array([first.setdefault(id(each), i) for i, each in enumerate(fields)])
        own = (self.lower + self.upper) / 2 - self.moves
        middle = np.einsum("kij,ki->kj", self.turns, own) / self.scale[:, None]
        reach = np.linalg.norm(self.upper - self.lower, axis=1) / 2 / self.scale
        i, j = np.triu_indices(3)
        square = np.square(middle).sum(axis=1)
        slack = (reach**2 + _ROUNDING * square - square)[:, None]
        self.balls = np.hstack([middle[:, i] * middle[:, j], 2 * middle, slack, np.ones((len(maps), 1))])

    def met(self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]) -> _Met:
        """The pairs. Of a ray p + t v, whose point nearest to 0 is q, the ball of radius r around a box's middle m is
        met where |m - q|² - (m · v)² <= r²: one product of what m and r give with what q and v give.
        """
        nearest = positions - (positions * directions).sum(axis=1, keepdims=True) * directions
        i, j = np.triu_indices(3)
        products = directions[:, i] * directions[:, j] * np.where(i == j, 1.0, 2.0)
        least = (_ROUNDING - 1) * np.square(nearest).sum(axis=1, keepdims=True)
        lines = np.hstack([products, nearest, np.ones_like(least), least])
        count, step = len(self.balls), max(1, _MOST_PAIRS // len(self.balls))
        parts = range(0, len(lines), step)
        pairs = [k * count + np.flatnonzero(lines[k : k + step] @ self.balls.T >= 0) for k in parts]
        ray, member = np.divmod(np.concatenate(pairs) if pairs else np.zeros(0, int), count)
        ways = np.einsum("pij,pj->pi", self.turns[member], directions[ray])
        turned = np.einsum("pij,pj->pi", self.turns[member], positions[ray])
        starts = self.scale[member, None] * turned + self.moves[member]
        distance, meets = np.zeros(len(ray)), np.zeros(len(ray), bool)
        for own, rows in _grouped(self.own[member], np.arange(len(ray))):
            found = rays.enter_box(starts[rows], ways[rows], self.lower[own], self.upper[own])
            starts[rows], distance[rows], meets[rows] = found
        entry = distance / self.scale[member]
        order = np.flatnonzero(meets)
        order = order[np.lexsort((entry[order], ray[order]))]
        return _Met(ray[order], member[order], entry[order], starts[order], ways[order])


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

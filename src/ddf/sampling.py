"""Oriented-point samples of a mesh: the six types of [DDF22] appendix A, their truth by ray casting, packed.

Letters: B the box, S the surface, q0 a point uniform by area on S with normal n0, v0 the direction that a sample looks
back along. Each `draw_*` gives positions and directions only; `extract` rounds them to their stored form, casts
exactly those rays and packs the answers. Everything is in the field frame.

Choices where the paper is silent:
- S starts on the surface. It is lifted by `raycast.SURFACE_OFFSET` (1e-5 of half the box's longest side) off its own
  triangle,
  to the side that v points to, and the depth is corrected for that: its own triangle, and others in its plane, cannot
  be the hit; a second sheet closer than that is not seen.
- O: the offset line is shortened where q0 + s eps n0 would leave B (the other side is tried first), then p is drawn on
  the line's part inside B as for T. So p is in B always, and a tenth lies on its boundary exactly.
- Hits from behind count. Triangles without an area get no samples.
"""

import dataclasses
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float

from ddf import checks, meshes, packing, raycast, seeding
from ddf.mesh_io import Mesh

BOUNDARY_SHARE = 0.1  # of the positions of types A, T and O lie on the boundary of B. Source: [DDF22] app. A
_ERROR_PROBE = 2000  # samples of each type whose packing error is measured


@dataclass(frozen=True)
class Counts:
    """Samples of each type per shape."""

    U: int = 20_000
    A: int = 20_000
    B: int = 10_000
    S: int = 10_000
    T: int = 10_000
    O: int = 10_000  # noqa: E741  (the paper's letter)

    def __post_init__(self) -> None:
        for kind, count in self.items():
            if count < 1:
                raise checks.InputError(f"samples.counts.{kind} must be >= 1; got {count}")

    def items(self) -> list[tuple[str, int]]:
        """Pairs of type and count in the fixed order of `packing.KINDS`."""
        return [(kind, getattr(self, kind)) for kind in packing.KINDS]


@dataclass(frozen=True)
class SamplesConfig:
    """What is drawn from each shape.

    epsilon_o: distance of O samples from the tangent line, in field units (0.05 single shape, 0.02 ShapeNet).
    offsets: every O sample at that distance ("fixed"), or uniform up to it ("uniform"; "maximum" in [DDF22] app. D).
    box: the cube [-1, 1]^3 ("cube") or the shape's own box ("tight").
    cloud_points: points of the ground-truth cloud, met within 10 %.
    shard_size: shapes in one file.
    """

    counts: Counts = dataclasses.field(default_factory=Counts)
    epsilon_o: float = 0.02
    offsets: Literal["fixed", "uniform"] = "uniform"
    box: Literal["cube", "tight"] = "cube"
    cloud_points: int = 8000
    shard_size: int = 16
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.epsilon_o < 1:
            raise checks.InputError(f"samples.epsilon_o must be in (0, 1); got {self.epsilon_o}")
        if self.offsets not in ("fixed", "uniform"):
            raise checks.InputError(f"samples.offsets must be fixed or uniform; got {self.offsets!r}")
        if self.box not in ("cube", "tight"):
            raise checks.InputError(f"samples.box must be cube or tight; got {self.box!r}")
        if not 10 <= self.cloud_points <= 1_000_000:
            raise checks.InputError(f"samples.cloud_points must be in [10, 1e6]; got {self.cloud_points}")
        if self.shard_size < 1:
            raise checks.InputError(f"samples.shard_size must be >= 1; got {self.shard_size}")


@dataclass(frozen=True)
class Box:
    """Axis-aligned box B."""

    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Draw:
    """Oriented points before rounding; `normals` only where they start on the surface (the surface's own)."""

    positions: Float[np.ndarray, "n 3"]
    directions: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"] | None = None


CUBE = Box(-np.ones(3), np.ones(3))


def unit_vectors(count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Directions uniform on the sphere (Archimedes: height and turn are uniform)."""
    height, turn = 2 * rng.random(count) - 1, 2 * np.pi * rng.random(count)
    radius = np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)


def _tangents(normals: Float[np.ndarray, "n 3"], rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Directions uniform on the circle normal to each vector, on the basis of Duff et al. 2017 (revisiting Frisvad)."""
    x, y, z = normals.T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=1)
    second = np.stack([b, sign + y * y * a, -y], axis=1)
    turn = 2 * np.pi * rng.random(len(normals))[:, None]
    return np.cos(turn) * first + np.sin(turn) * second


def _exit(points: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], box: Box) -> Float[np.ndarray, "n 3"]:
    """Distance along each axis at which a ray from inside the box leaves it; `inf` on axes it runs normal to."""
    wall = np.where(directions > 0, box.upper, box.lower) - points
    still = directions == 0
    return np.where(still, np.inf, np.maximum(wall / np.where(still, 1.0, directions), 0.0))


def _back_along(
    origins: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], box: Box, rng: np.random.Generator
) -> Draw:
    """p on the segment from each origin along v0 to the boundary of B (a tenth exactly on it), and v = -v0."""
    count = len(origins)
    axes = _exit(origins, directions, box)
    axis, reach = axes.argmin(axis=1), axes.min(axis=1)
    on_boundary = rng.permutation(count) < round(BOUNDARY_SHARE * count)
    share = np.where(on_boundary, 1.0, rng.random(count))
    positions = np.clip(origins + (share * reach)[:, None] * directions, box.lower, box.upper)
    rows = np.flatnonzero(on_boundary)
    walls = np.where(directions > 0, box.upper, box.lower)
    positions[rows, axis[rows]] = walls[rows, axis[rows]]
    return Draw(positions, -directions)


def draw_uniform(box: Box, count: int, rng: np.random.Generator) -> Draw:
    """U: p ~ U[B], v ~ U[S²]."""
    positions = box.lower + (box.upper - box.lower) * rng.random((count, 3))
    return Draw(positions, unit_vectors(count, rng))


def draw_at_surface(scene: raycast.Scene, box: Box, count: int, rng: np.random.Generator) -> Draw:
    """A: q0 by area, v0 ~ U[S²], p on the segment from q0 along v0 to ∂B, v = -v0."""
    origins, _ = meshes.sample_surface(scene.mesh, count, rng)
    return _back_along(np.clip(origins, box.lower, box.upper), unit_vectors(count, rng), box, rng)


def draw_bounding(box: Box, count: int, rng: np.random.Generator) -> Draw:
    """B: p ~ U[∂B], v uniform on the hemisphere that points inwards."""
    sides = box.upper - box.lower
    areas = np.repeat([sides[1] * sides[2], sides[2] * sides[0], sides[0] * sides[1]], 2)
    wall = np.minimum(np.searchsorted(np.cumsum(areas), rng.random(count) * areas.sum(), side="right"), 5)
    rows, axis, upper = np.arange(count), wall // 2, wall % 2 == 1
    positions = box.lower + sides * rng.random((count, 3))
    positions[rows, axis] = np.where(upper, box.upper[axis], box.lower[axis])
    directions = unit_vectors(count, rng)
    inwards = np.abs(directions[rows, axis])
    directions[rows, axis] = np.where(upper, -inwards, inwards)
    return Draw(positions, directions)


def draw_surface(scene: raycast.Scene, box: Box, count: int, rng: np.random.Generator) -> Draw:
    """S: p by area on S, v ~ U[S²]."""
    positions, face = meshes.sample_surface(scene.mesh, count, rng)
    return Draw(np.clip(positions, box.lower, box.upper), unit_vectors(count, rng), scene.normals[face])


def draw_tangent(scene: raycast.Scene, box: Box, count: int, rng: np.random.Generator) -> Draw:
    """T: as A, with v0 uniform in the tangent plane at q0."""
    origins, face = meshes.sample_surface(scene.mesh, count, rng)
    return _back_along(np.clip(origins, box.lower, box.upper), _tangents(scene.normals[face], rng), box, rng)


def draw_offset(
    scene: raycast.Scene, box: Box, count: int, rng: np.random.Generator, epsilon: float, uniform: bool
) -> Draw:
    """O: the line of a T sample moved by ±ε n0 (by a uniform share of it if `uniform`), p on its part inside B."""
    origins, face = meshes.sample_surface(scene.mesh, count, rng)
    origins, normals = np.clip(origins, box.lower, box.upper), scene.normals[face]
    size = epsilon * (rng.random(count) if uniform else np.ones(count))
    side = np.where(rng.random(count) < 0.5, -1.0, 1.0)[:, None] * normals
    room, other = _exit(origins, side, box).min(axis=1), _exit(origins, -side, box).min(axis=1)
    turned = (room < size) & (other > room)
    step = np.minimum(size, np.where(turned, other, room))
    moved = np.clip(origins + step[:, None] * np.where(turned[:, None], -side, side), box.lower, box.upper)
    return _back_along(moved, _tangents(normals, rng), box, rng)


def draw(kind: str, scene: raycast.Scene, config: SamplesConfig, count: int, rng: np.random.Generator) -> Draw:
    """`count` oriented points of one type, not yet rounded."""
    box = CUBE if config.box == "cube" else Box(*scene.mesh.box())
    if kind == "U":
        return draw_uniform(box, count, rng)
    if kind == "B":
        return draw_bounding(box, count, rng)
    if kind == "O":
        return draw_offset(scene, box, count, rng, config.epsilon_o, config.offsets == "uniform")
    functions = {"A": draw_at_surface, "S": draw_surface, "T": draw_tangent}
    return functions[kind](scene, box, count, rng)


def extract(mesh: Mesh, config: SamplesConfig, *names: str) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """All six types of one shape in stored form, and the largest errors of that form.

    Args:
      mesh: in the field frame (inside [-1, 1]^3).
      names: what tells this shape's random stream from others (category, id).
    Returns:
      `<type>.positions`, `.directions`, `.depth`, `.normals` (see `packing`), and the errors of `_packing_errors`, the
      largest over the types.
    Raises:
      InputError: the mesh leaves the cube, or has no triangle with an area.
    """
    lower, upper = mesh.box()
    if lower.min() < -1 - 1e-6 or upper.max() > 1 + 1e-6:
        raise checks.InputError(f"the mesh must lie in [-1, 1]^3; got {lower} to {upper}")
    scene, arrays, worst = raycast.Scene(mesh), {}, {}
    for kind, count in config.counts.items():
        drawn = draw(kind, scene, config, count, seeding.generator(config.seed, *names, kind))
        packed, errors = _cast_and_pack(scene, drawn)
        arrays |= {f"{kind}.{field}": values for field, values in packed.items()}
        worst = {name: max(value, worst.get(name, 0.0)) for name, value in errors.items()}
    return arrays, worst


def _cast_and_pack(scene: raycast.Scene, drawn: Draw) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    positions = packing.encode_positions(drawn.positions)
    directions = packing.encode_unit(drawn.directions, np.int16)
    starts = positions / packing.POSITION_STEPS
    looking = packing.decode_unit(torch.from_numpy(directions)).numpy()
    if drawn.normals is not None:
        slope = np.einsum("ij,ij->i", drawn.normals, looking)
        side = np.where(slope >= 0, raycast.SURFACE_OFFSET * scene.scale, -raycast.SURFACE_OFFSET * scene.scale)
        lifted = drawn.positions + side[:, None] * drawn.normals
        ahead = np.einsum("ij,ij->i", lifted - starts, looking)
    else:
        lifted, ahead = starts, np.zeros(len(starts))
    depth, face = scene.cast_local(scene.local(lifted).astype(np.float32), looking)
    depth = np.maximum(depth * scene.scale + ahead, 0.0)
    normals = raycast.facing_back(scene, face, looking)
    axis = np.array([0.0, 0.0, 1.0])
    codes = packing.encode_unit(np.where((face >= 0)[:, None], normals, axis), np.int8)
    packed = {"positions": positions, "directions": directions, "depth": packing.encode_depth(depth), "normals": codes}
    return packed, _packing_errors(drawn, packed, depth, normals)


def _packing_errors(
    drawn: Draw, packed: dict[str, np.ndarray], depth: Float[np.ndarray, "n"], normals: Float[np.ndarray, "n 3"]
) -> dict[str, float]:
    """Largest error of each stored type on the first samples. Positions and directions: how far the stored (and cast)
    ray is from the drawn one; no error of the truth. Depth and normals: error of the truth itself.
    """
    part = slice(0, _ERROR_PROBE)
    hit = np.isfinite(depth[part])
    as_tensor = {name: torch.from_numpy(values[part]) for name, values in packed.items()}
    stored_depth = packing.decode_depth(as_tensor["depth"]).double().numpy()
    turned = _angle_deg(packing.decode_unit(as_tensor["directions"]).double().numpy(), drawn.directions[part])
    tilted = _angle_deg(packing.decode_unit(as_tensor["normals"]).double().numpy()[hit], normals[part][hit])
    moved = np.abs(packing.decode_positions(as_tensor["positions"]).double().numpy() - drawn.positions[part])
    return {
        "position_shift": float(moved.max(initial=0.0)),
        "direction_shift_deg": float(turned.max(initial=0.0)),
        "depth_error": float(np.abs(stored_depth[hit] - depth[part][hit]).max(initial=0.0)),
        "normal_error_deg": float(tilted.max(initial=0.0)),
    }


def _angle_deg(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.einsum("ij,ij->i", a, b)))

"""How oriented points of each sample type are drawn, before they are rounded and cast (`extraction`). [DDF22] app. A.

Letters: B the box, S the surface, q0 a point uniform by area on S with normal n0, v0 the direction that a sample looks
back along. Draws are float32; their memory holds one coordinate after the other.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.mesh_io import Mesh, face_normals


@dataclass(frozen=True)
class Surface:
    """Triangles ready for drawing points uniform by area; those without an area get none. InputError where none has
    one.
    """

    corners: Float[np.ndarray, "m 3 3"]
    normals: Float[np.ndarray, "m 3"]
    areas: Float[np.ndarray, "m"]

    def __post_init__(self) -> None:
        if not self.areas.sum() > 0:
            raise checks.InputError("the mesh must have a triangle with an area; got none")

    @classmethod
    def of(cls, mesh: Mesh) -> "Surface":
        """All triangles of a mesh."""
        return cls(mesh.triangles, *face_normals(mesh))

    @functools.cached_property
    def _ends(self) -> Float[np.ndarray, "m"]:
        return np.cumsum(self.areas)

    @functools.cached_property
    def _last(self) -> int:
        """The last triangle with an area."""
        return int(np.flatnonzero(self.areas > 0)[-1])

    @functools.cached_property
    def _frames(self) -> Float[np.ndarray, "m 9"]:
        """First corner, and the edges from it to the others."""
        first, second, third = (self.corners[:, corner] for corner in range(3))
        return np.concatenate([first, second - first, third - first], axis=1)

    def draw(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, "count 3"], Int[np.ndarray, "count"]]:
        """Points, of the type of the corners, and the triangle of each, in random order."""
        steps = np.cumsum(rng.standard_exponential(count + 1))  # over their end: uniform numbers in ascending order
        face = np.searchsorted(self._ends * (steps[-1] / self._ends[-1]), steps[:-1], side="right")
        np.minimum(face, self._last, out=face)  # whatever rounding says
        rng.shuffle(face)
        kind = self.corners.dtype
        root, along = np.sqrt(rng.random(count)).astype(kind), rng.random(count).astype(kind)
        second = root * along
        first = root - second
        rows = self._frames.take(face, axis=0).T
        points = np.zeros((3, count), kind)
        for axis, point in enumerate(points):
            np.multiply(first, rows[3 + axis], out=point)
            point += rows[axis]
            point += second * rows[6 + axis]
        return points.T, face


BOUNDARY_SHARE = 0.1  # of the positions of types A, T and O lie on the boundary of B. Source: [DDF22] app. A


@dataclass(frozen=True)
class Box:
    """Axis-aligned box B, float32."""

    lower: Float[np.ndarray, "3"]
    upper: Float[np.ndarray, "3"]

    def __post_init__(self) -> None:
        object.__setattr__(self, "lower", self.lower.astype(np.float32))
        object.__setattr__(self, "upper", self.upper.astype(np.float32))


@dataclass(frozen=True)
class Draw:
    """Oriented points before rounding.

    normals: n0, of S and T. starts_on: S, at q0.
    """

    positions: Float[np.ndarray, "n 3"]
    directions: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"] | None = None
    starts_on: bool = False


CUBE = Box(-np.ones(3), np.ones(3))


@dataclass(frozen=True)
class Domain:
    """What samples of one mesh are drawn from.

    epsilon_o: offset of O samples, field units; of each at most that if `uniform_offsets`.
    """

    surface: Surface
    box: Box
    epsilon_o: float = 0.0
    uniform_offsets: bool = False


def unit_vectors(count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Directions uniform on the sphere (Archimedes: height and turn are uniform)."""
    height = 2 * _shares(count, rng) - 1
    radius = np.sqrt((1 - height) * (1 + height))
    turn = _turns(count, rng)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height]).T


def _shares(count: int, rng: np.random.Generator) -> Float[np.ndarray, "count"]:
    """Uniform on [0, 1), float32."""
    return rng.random(count, dtype=np.float32)


def _turns(count: int, rng: np.random.Generator) -> Float[np.ndarray, "count"]:
    return _shares(count, rng) * np.float32(2 * np.pi)


def _tangents(normals: Float[np.ndarray, "n 3"], rng: np.random.Generator) -> Float[np.ndarray, "n 3"]:
    """Directions uniform on the circle normal to each vector, on the basis of Duff et al. 2017 (revisiting Frisvad)."""
    x, y, z = normals.T
    sign = np.copysign(np.float32(1), z)
    a = -1 / (sign + z)
    b = x * y * a
    turn = _turns(len(normals), rng)
    first, second = np.cos(turn), np.sin(turn)
    signed = sign * first
    return np.stack(
        [
            first + signed * x * x * a + second * b,
            signed * b + second * (sign + y * y * a),
            -signed * x - second * y,
        ]
    ).T


def _exit(points: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"], box: Box) -> Float[np.ndarray, "3 n"]:
    """Distance along each axis at which a ray from inside the box leaves it; `inf` on axes it runs normal to."""
    reach, other = np.zeros((3, len(points)), np.float32), np.zeros(len(points), np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):  # 0/0 on a wall, which the ray runs along: never leaves there
        for found, p, v, lower, upper in zip(reach, points.T, directions.T, box.lower, box.upper, strict=True):
            np.divide(np.subtract(lower, p, out=found), v, out=found)
            np.divide(np.subtract(upper, p, out=other), v, out=other)
            np.fmax(found, other, out=found)
    np.fmin(reach, np.inf, out=reach)  # in place of NaN
    return np.clip(reach, 0, np.inf, out=reach)


def _inside(points: Float[np.ndarray, "n 3"], box: Box) -> Float[np.ndarray, "n 3"]:
    """Points clipped to the box."""
    return np.clip(points.T, box.lower[:, None], box.upper[:, None]).T


def _back_along(
    origins: Float[np.ndarray, "n 3"],
    directions: Float[np.ndarray, "n 3"],
    box: Box,
    rng: np.random.Generator,
    normals: Float[np.ndarray, "n 3"] | None = None,
) -> Draw:
    """p on the segment from each origin along v0 to the boundary of B (a tenth exactly on it), v = -v0."""
    count = len(origins)
    axes = _exit(origins, directions, box)
    reach = np.minimum(np.minimum(axes[0], axes[1]), axes[2])
    rows = rng.choice(count, _boundary_count(count, rng), replace=False, shuffle=False)
    share = _shares(count, rng)
    share[rows] = 1
    reach *= share
    positions = directions.T * reach
    positions += origins.T
    positions = _inside(positions.T, box)
    walls = np.where(directions.T.take(rows, axis=1) > 0, box.upper[:, None], box.lower[:, None])
    ends = positions.T.take(rows, axis=1)
    np.copyto(ends, walls, where=axes.take(rows, axis=1) == reach.take(rows))  # whose share is 1
    positions.T[:, rows] = ends
    return Draw(positions, -directions, normals)


def _boundary_count(count: int, rng: np.random.Generator) -> int:
    """`BOUNDARY_SHARE` of `count`, on average where that is no whole number."""
    rest, whole = math.modf(BOUNDARY_SHARE * count)
    return int(whole) + int(rest > 0 and rng.random() < rest)


def draw_uniform(domain: Domain, count: int, rng: np.random.Generator) -> Draw:
    """U: p ~ U[B], v ~ U[S²]."""
    return Draw(_in_box(domain.box, count, rng), unit_vectors(count, rng))


def _in_box(box: Box, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    positions = rng.random((3, count), dtype=np.float32)
    positions *= (box.upper - box.lower)[:, None]
    positions += box.lower[:, None]
    return positions.T


def draw_at_surface(domain: Domain, count: int, rng: np.random.Generator) -> Draw:
    """A: q0 by area, v0 ~ U[S²], p on the segment from q0 along v0 to ∂B, v = -v0."""
    origins, _ = domain.surface.draw(count, rng)
    return _back_along(_inside(origins, domain.box), unit_vectors(count, rng), domain.box, rng)


def draw_bounding(domain: Domain, count: int, rng: np.random.Generator) -> Draw:
    """B: p ~ U[∂B], v uniform on the hemisphere that points inwards."""
    box = domain.box
    sides = box.upper - box.lower
    areas = np.repeat([sides[1] * sides[2], sides[2] * sides[0], sides[0] * sides[1]], 2)
    wall = np.minimum(np.searchsorted(np.cumsum(areas), _shares(count, rng) * areas.sum(), side="right"), 5)
    positions, directions = _in_box(box, count, rng), unit_vectors(count, rng)
    for axis, (position, turned) in enumerate(zip(positions.T, directions.T, strict=True)):
        rows = np.flatnonzero(wall >> 1 == axis)
        upper = wall[rows] % 2 == 1
        position[rows] = np.where(upper, box.upper[axis], box.lower[axis])
        turned[rows] = np.copysign(turned[rows], np.where(upper, np.float32(-1), np.float32(1)))
    return Draw(positions, directions)


def draw_surface(domain: Domain, count: int, rng: np.random.Generator) -> Draw:
    """S: p by area on S, v ~ U[S²]."""
    positions, face = domain.surface.draw(count, rng)
    return Draw(
        _inside(positions, domain.box), unit_vectors(count, rng), _rows(domain.surface.normals, face), starts_on=True
    )


def draw_tangent(domain: Domain, count: int, rng: np.random.Generator) -> Draw:
    """T: as A, with v0 uniform in the tangent plane at q0."""
    origins, face = domain.surface.draw(count, rng)
    normals = _rows(domain.surface.normals, face)
    return _back_along(_inside(origins, domain.box), _tangents(normals, rng), domain.box, rng, normals)


def _rows(normals: Float[np.ndarray, "m 3"], face: Int[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
    return normals.take(face, axis=0).T.copy().T


def draw_offset(domain: Domain, count: int, rng: np.random.Generator) -> Draw:
    """O: the line of a T sample moved by ±ε n0 (by a share of it if `uniform_offsets`), p on its part inside B."""
    origins, face = domain.surface.draw(count, rng)
    origins, normals = _inside(origins, domain.box), _rows(domain.surface.normals, face)
    size = _shares(count, rng) if domain.uniform_offsets else np.ones(count, np.float32)
    size *= domain.epsilon_o
    side = np.where(_shares(count, rng) < 0.5, np.float32(-1), np.float32(1))[:, None] * normals
    room, other = _exit(origins, side, domain.box).min(axis=0), _exit(origins, -side, domain.box).min(axis=0)
    turned = (room < size) & (other > room)
    step = np.minimum(size, np.where(turned, other, room))
    moved = _inside(origins + np.where(turned, -step, step)[:, None] * side, domain.box)
    return _back_along(moved, _tangents(normals, rng), domain.box, rng)

"""The shapes of the fields that come with the package, all our own: rabbit, nested boxes, armchair, airliner."""

from collections.abc import Callable

import numpy as np
import pymeshlab
import trimesh
from jaxtyping import Float

from ddf.core import seeding
from ddf.data.synthetic import assemble, chairs, parts, planes
from ddf.geometry.mesh_io import Mesh

_SHARPNESS = 5.0  # of the blend between blobs: the larger, the less they melt into each other
_CELL = 0.018  # of the grid on which the level set is found; the rabbit is about 1.9 tall
_NEWTON_STEPS = 4  # bring vertices to within 1e-6 of it

# centre (x right, y up, z forward), half axes, degrees about x and then about z; pairs are given once, with x > 0
_RABBIT_MIDDLE = (
    ((0.0, 0.02, -0.10), (0.40, 0.42, 0.52), 18.0, 0.0),  # body
    ((0.0, 0.22, 0.22), (0.27, 0.34, 0.27), -10.0, 0.0),  # chest
    ((0.0, 0.62, 0.42), (0.23, 0.22, 0.28), 12.0, 0.0),  # head
    ((0.0, 0.53, 0.64), (0.12, 0.10, 0.12), 0.0, 0.0),  # muzzle
    ((0.0, 0.05, -0.66), (0.15, 0.15, 0.14), 0.0, 0.0),  # tail
)
_RABBIT_PAIRS = (
    ((0.13, 1.08, 0.24), (0.085, 0.36, 0.055), -22.0, -14.0),  # ear
    ((0.30, -0.12, -0.22), (0.19, 0.30, 0.32), 0.0, 0.0),  # haunch
    ((0.28, -0.38, 0.08), (0.12, 0.09, 0.30), 0.0, 0.0),  # hind foot
    ((0.15, -0.22, 0.40), (0.09, 0.30, 0.10), 8.0, 0.0),  # fore leg
    ((0.15, -0.41, 0.48), (0.10, 0.07, 0.15), 0.0, 0.0),  # fore foot
)


def _turn(about_x_deg: float, about_z_deg: float) -> Float[np.ndarray, "3 3"]:
    return parts.rotation("x", np.radians(about_x_deg)) @ parts.rotation("z", np.radians(about_z_deg))


def _blobs() -> list[tuple[np.ndarray, np.ndarray]]:
    """Centre c and M = (R D^-1)ᵀ of each: exp(s (1 - |M (p - c)|²)) is 1 on the ellipsoid, larger inside."""
    every = list(_RABBIT_MIDDLE)
    for (x, y, z), half_axes, about_x, about_z in _RABBIT_PAIRS:
        every += [((s * x, y, z), half_axes, about_x, s * about_z) for s in (1.0, -1.0)]
    return [(np.array(c), (_turn(about_x, about_z) / np.array(axes)).T) for c, axes, about_x, about_z in every]


def _formula(centre: np.ndarray, rows: np.ndarray) -> str:
    """A blob as text."""
    squares = []
    for row in rows:
        terms = "+".join(f"({w:.6f})*({axis}-({c:.6f}))" for w, axis, c in zip(row, "xyz", centre, strict=True))
        squares.append(f"({terms})^2")
    return f"exp({_SHARPNESS}*(1-({'+'.join(squares)})))"


def _onto_level_set(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Points near where the sum of blobs is 1, moved there by Newton's method on its logarithm."""
    for _ in range(_NEWTON_STEPS):
        total, slope = np.zeros(len(points)), np.zeros_like(points)
        for centre, rows in _blobs():
            away = (points - centre) @ rows.T
            value = np.exp(_SHARPNESS * (1 - np.square(away).sum(-1)))
            total += value
            slope -= 2 * _SHARPNESS * value[:, None] * (away @ rows)
        points = points - (total * np.log(total) / np.square(slope).sum(-1))[:, None] * slope
    return points


def rabbit() -> Mesh:
    """A sitting rabbit, closed and smooth, Y up, facing +Z: the level set of a sum of blobs."""
    made = pymeshlab.MeshSet()
    low, high = (-0.75, -0.65, -1.0), (0.75, 1.65, 1.0)
    made.create_implicit_surface(
        voxelsize=_CELL,
        **{f"min{axis}": value for axis, value in zip("xyz", low, strict=True)},
        **{f"max{axis}": value for axis, value in zip("xyz", high, strict=True)},
        expr=f"1-({'+'.join(_formula(*blob) for blob in _blobs())})",
    )
    mesh = made.current_mesh()  # cells see a steep sum as linear: its vertices lie in terraces
    return Mesh(_onto_level_set(mesh.vertex_matrix()), mesh.face_matrix().astype(np.int64))


def _box(half: float, hole: float | None = None) -> Mesh:
    """The cube [-half, half]^3; with a hole, a square window of that half width in the side +Z."""
    corners = np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-half, half)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4)]
    outer = (1, 5, 7, 3)  # the side +Z
    if hole is None:
        quads.append(outer)
    else:
        window = corners[list(outer)] * [hole / half, hole / half, 1.0]
        corners = np.concatenate([corners, window])
        quads += [(outer[i], outer[(i + 1) % 4], 8 + (i + 1) % 4, 8 + i) for i in range(4)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return Mesh(corners, np.array(triangles))


def _joined(one: Mesh, other: Mesh) -> Mesh:
    vertices = np.concatenate([one.vertices, other.vertices])
    return Mesh(vertices, np.concatenate([one.faces, other.faces + len(one.vertices)]))


def nested() -> Mesh:
    """A box with a window, and a smaller cube turned inside it: what a field of distances from outside cannot hold."""
    inner = _box(0.42)
    return _joined(_box(1.0, hole=0.55), Mesh(inner.vertices @ _turn(35.0, 30.0).T, inner.faces))


def room() -> Mesh:
    """Five sides of the cube [-1, 1]^3, open to +Z, as in [DDF22] fig. `simpleroom`."""
    whole = _box(1.0)
    return Mesh(whole.vertices, whole.faces[:-2])


def furnished(scale: float, at: tuple[float, float, float]) -> Mesh:
    """The room with the rabbit in it, as one mesh: its vertices times `scale`, then moved to `at`."""
    inside = rabbit()
    return _joined(room(), Mesh(scale * inside.vertices + np.array(at), inside.faces))


def ball(radius: float, subdivisions: int) -> Mesh:
    """A sphere about the origin: an icosahedron divided so often, its corners on the sphere."""
    shape = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return Mesh(np.array(shape.vertices), np.array(shape.faces))


def two_spheres(radius: float = 0.4, distance: float = 1.1) -> Mesh:
    """Two spheres side by side along x, as `geometry.primitives.two_spheres`, in 10,240 triangles."""
    one = ball(radius, 4)
    shift = np.array([distance / 2, 0.0, 0.0])
    return _joined(Mesh(one.vertices - shift, one.faces), Mesh(one.vertices + shift, one.faces))


def _procedural(build: Callable[[np.random.Generator], list], seed: int) -> Mesh:
    random = seeding.generator(seed, "showcase")
    shape = assemble.shape(build(random), random)
    return Mesh(shape.vertices, shape.triangles)


SHAPES: dict[str, Callable[[], Mesh]] = {
    "rabbit": rabbit,
    "nested": nested,
    "armchair": lambda: _procedural(chairs.build, 2),
    "airliner": lambda: _procedural(planes.build, 1),
}

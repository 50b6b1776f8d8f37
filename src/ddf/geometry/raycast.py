"""Rays and points asked of triangle meshes, in float64 (`triangle_tree`).

The surface is two-sided: a ray that starts inside meets the wall from behind, and normals face back.

Depths are as exact as float64: rays 1e-9 of the size beside an edge have those of rational numbers (tests).
"""

import functools
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float, Int

from ddf.core import arrays
from ddf.core.arrays import Array
from ddf.geometry import rays
from ddf.geometry.mesh_io import Mesh, face_normals, have_area

if TYPE_CHECKING:
    from ddf.geometry import triangle_tree

_DIRECTIONS, _PORTIONS = 64, 8  # to look from outside; of them, one after the other: the first sees most points
SURFACE_OFFSET = 1e-5  # of half the longest side: over 80 float32 steps at 1, under a fifth of the stored depth's step


class Scene:
    """A mesh ready for ray casting and distance queries; triangles without an area are left out.

    `mesh` keeps all triangles, and every face index that comes back refers to it.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.normals, self.areas = face_normals(mesh)
        self.kept = np.flatnonzero(have_area(mesh, self.areas))
        met = np.zeros(len(mesh.vertices), dtype=bool)
        met[mesh.faces[self.kept]] = True
        used = mesh.vertices[met]
        lower, upper = (used.min(axis=0), used.max(axis=0)) if len(used) else (np.zeros(3), np.zeros(3))
        self.centre = lower + (upper - lower) / 2
        self.scale = float((upper - lower).max()) / 2 or 1.0

    @functools.cached_property
    def _tree(self) -> "triangle_tree.Tree":
        """Made when the first ray is cast: a GPU casts without it, and without numba."""
        from ddf.geometry import triangle_tree

        return triangle_tree.of(self.mesh.triangles[self.kept])

    def local(self, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Positions with the mesh's box centred at 0 and half its longest side as unit."""
        return (np.asarray(positions, dtype=np.float64) - self.centre) / self.scale

    def first_hits(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> tuple[Float[np.ndarray, "n"], Int[np.ndarray, "n"]]:
        """Depth (`inf` on a miss) and triangle (-1 on a miss) of rays in the mesh's frame."""
        depth, kept = self._tree.first(positions, directions)
        return depth, np.append(self.kept, -1)[kept]

    def cast_local(
        self, local: Float[np.ndarray, "n 6"], behind: float = 0.0
    ) -> tuple[Float[np.ndarray, "n"], Int[np.ndarray, "n"]]:
        """Depth of rays (position, direction) in local coordinates, and index into `kept`, `inf` and -1 on a miss.

        behind: what lies so little behind a start is met as well, at depth 0.
        """
        directions = local[:, 3:].astype(np.float64)
        depth, kept = self._tree.first(self._placed(local[:, :3]) - behind * self.scale * directions, directions)
        return np.maximum(depth / self.scale - behind, 0), kept

    def _placed(self, local: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """The inverse of `local`."""
        return local.astype(np.float64) * self.scale + self.centre

    def blocked_local(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> Bool[np.ndarray, "n"]:
        """Whether rays in local coordinates meet anything (faster than finding what)."""
        return self._tree.first(self._placed(positions), directions, enough=np.inf)[1] >= 0

    def met_along(
        self, starts: Float[np.ndarray, "n 3"], ends: Float[np.ndarray, "n 3"]
    ) -> tuple[Int[np.ndarray, "k"], Int[np.ndarray, "k"]]:
        """Segment and triangle of all that segments meet."""
        segment, kept, reached = self._tree.met(starts, ends - starts)
        return segment[reached <= 1.0], self.kept[kept[reached <= 1.0]]

    def distance(self, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Unsigned distance to the surface, in the mesh's unit."""
        return np.linalg.norm(self.closest(positions) - positions, axis=1)

    def closest(self, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """The closest points of the surface, in the mesh's frame."""
        return self._tree.closest(positions)

    def outside(self, positions: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Whether points lie outside a closed mesh (parity of crossings along three rays, by majority)."""
        ways = np.random.default_rng(0).standard_normal((3, 3))
        ray, _, _ = self._tree.met(np.repeat(positions, 3, axis=0), np.tile(ways, (len(positions), 1)))
        odd = np.bincount(ray, minlength=3 * len(positions)) % 2
        return odd.reshape(-1, 3).sum(axis=1) < 2


def cast(scene: Scene | Mesh, points: rays.OrientedPoints[Array]) -> rays.RayHits[Array]:
    """What each oriented point sees first, in the mesh's own frame, in the library of the points.

    Depth and normals are float64.
    """
    scene = scene if isinstance(scene, Scene) else Scene(scene)
    positions, directions = flat(points.positions), flat(points.directions)
    depth, face = scene.first_hits(positions, directions)
    return hits(scene, directions, depth, face, points.positions)


def float32_bound(mesh: Mesh, points: rays.OrientedPoints) -> float:
    """How far off the mesh rays may pass that were written in float32, in its unit: half a step of the positions, and
    of the directions over the longest way from a start to the mesh.
    """
    positions = np.asarray(points.positions, dtype=np.float64).reshape(-1, 3)
    lower, upper = mesh.box()
    away = np.linalg.norm(positions - (lower + upper) / 2, axis=1).max(initial=0.0)
    return float(2.0**-24 * (np.abs(positions).max(initial=0.0) + away))


def flat(vectors: Float[Array, "*batch 3"]) -> Float[np.ndarray, "n 3"]:
    """The vectors as float64 numpy, one a row."""
    return arrays.to_numpy(vectors).astype(np.float64, copy=False).reshape(-1, 3)


def hits(
    scene: Scene, directions: np.ndarray, depth: np.ndarray, face: np.ndarray, asked: Float[Array, "*batch 3"]
) -> rays.RayHits[Array]:
    """What the rays met, in the library and the shape of the positions that were asked for."""
    xp, shape = arrays.namespace(asked), asked.shape[:-1]
    return rays.RayHits(
        depth=xp.asarray(depth.reshape(shape)),
        visible=xp.asarray((face >= 0).reshape(shape)),
        normals=xp.asarray(facing_back(scene, face, directions).reshape(*shape, 3)),
        face=xp.asarray(face.reshape(shape)),
    )


def facing_back(
    scene: Scene, face: Int[np.ndarray, "n"], directions: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """Unit normals of the triangles hit, turned so that n·v <= 0; zero on a miss."""
    if len(scene.normals) == 0:
        return np.zeros((len(face), 3))
    normals = scene.normals[face]
    slope = np.einsum("ij,ij->i", normals, directions)
    normals *= np.where(face < 0, 0.0, np.where(slope > 0, -1.0, 1.0))[:, None]
    return normals


def visible_from_outside(
    scene: Scene, points: Float[np.ndarray, "n 3"], face: Int[np.ndarray, "n"]
) -> Bool[np.ndarray, "n"]:
    """Whether surface points are the first hit of some ray from outside the mesh.

    A point is visible if a ray from it escapes along one of 64 spread directions. The start is lifted off the
    point's own triangle to the ray's side. Points seen only through narrow gaps (under about .2 steradians)
    can be called hidden.
    """
    starts, normals = scene.local(points), scene.normals[face]
    visible = np.zeros(len(starts), dtype=bool)
    spread = rays.evenly_spread(_DIRECTIONS)
    for block in (spread[first::_PORTIONS] for first in range(_PORTIONS)):  # each over the whole sphere
        left = np.flatnonzero(~visible)
        if len(left) == 0:
            break
        directions = np.tile(block, (len(left), 1))
        normal = np.repeat(normals[left], len(block), axis=0)
        side = np.where(np.einsum("ij,ij->i", normal, directions) >= 0, 1.0, -1.0)
        lifted = np.repeat(starts[left], len(block), axis=0) + SURFACE_OFFSET * side[:, None] * normal
        escaped = ~scene.blocked_local(lifted, directions)
        visible[left] = escaped.reshape(len(left), len(block)).any(axis=1)
    return visible

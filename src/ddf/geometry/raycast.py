"""First hits of oriented points on triangle meshes: Open3D (float32, fast) and an exact float64 reference.

Both treat the surface as two-sided: a ray that starts inside meets the wall from behind, and normals face back.
Rays start where they enter the mesh's box, and the box is centred and scaled to 1 first, so that neither a far camera
nor a mesh far from its origin costs float32 precision. A start next to a face can be rounded through it: so Open3D's
rays begin a little earlier, and where that meets something, float64 decides what lies before the start and what behind.
"""

import functools
from fractions import Fraction
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int, UInt

from ddf.core import arrays, extras
from ddf.core.arrays import Array
from ddf.geometry import rays
from ddf.geometry.mesh_io import Mesh, face_normals, have_area

_DIRECTIONS, _PORTIONS = 64, 8  # to look from outside; of them, one after the other: the first sees most points
_MARGIN = 1e-3  # of half the longest side: rays enter a box larger than the mesh, so that flat meshes lie inside it
BACK = 1e-3  # of half the longest side: at 1/1000 of right angles still 16 float32 steps off a face at the start
SURFACE_OFFSET = 1e-5  # of half the longest side: over 80 float32 steps at 1, under a fifth of the stored depth's step
_EPSILON = float(np.finfo(np.float64).eps)
_ROUNDINGS = 64  # half-steps that an edge function may be off by, in units of its largest product (counted by hand: 40)
_DEPTH = 1e-11  # of the depth: what rounding may cost before rational numbers are asked


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
        self.half_sides = (upper - lower) / 2 / self.scale + _MARGIN

    @functools.cached_property
    def _scene(self) -> Any:
        """Open3D's, made when the first ray is cast: a GPU casts without it."""
        o3d = _open3d()
        scene = o3d.t.geometry.RaycastingScene()
        if len(self.kept):
            vertices = np.clip(self.local(self.mesh.vertices), -2.0, 2.0).astype(np.float32)  # what nothing uses
            scene.add_triangles(_tensor(vertices), _tensor(self.mesh.faces[self.kept].astype(np.uint32)))
        return scene

    def local(self, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Positions with the mesh's box centred at 0 and half its longest side as unit."""
        return (np.asarray(positions, dtype=np.float64) - self.centre) / self.scale

    def first_hits(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> tuple[Float[np.ndarray, "n"], Int[np.ndarray, "n"]]:
        """Depth (float64, `inf` on a miss) and triangle (-1 on a miss) of rays in the mesh's frame.

        The triangle comes from float32, the depth from its plane (`_plane_depth`). A start nearer to a face than
        float32 can tell is on the side that float64 gives it, unless the ray runs within 1e-3 of parallel to the face.
        """
        local, begin, meets = self.entering(positions, directions)
        local = local.astype(np.float32)
        depth, face = self.cast_local(local)
        hit = np.flatnonzero(meets & (face >= 0))
        depth = begin + depth
        near = hit[depth[hit] < BACK]
        found, triangle = np.full(len(local), np.inf), np.full(len(local), -1)
        triangle[hit] = face[hit]
        found[hit] = self._plane_depth(positions[hit], directions[hit], face[hit], depth[hit] * self.scale)
        if len(near):  # Open3D's list of no rays ends the process
            first = self._first_ahead(positions[near], directions[near], local[near], begin[near])
            found[near], triangle[near] = first
        return np.where(triangle >= 0, np.maximum(found, 0.0), np.inf), triangle

    def entering(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> tuple[Float[np.ndarray, "n 6"], Float[np.ndarray, "n"], Bool[np.ndarray, "n"]]:
        """Rays in local coordinates that begin `BACK` before their start, or before the box where that lies outside;
        how far along they begin, and whether they meet the box.
        """
        starts, directions = self.local(positions), np.asarray(directions, dtype=np.float64)
        entry, leave = rays.box_span(starts, directions, -self.half_sides, self.half_sides)
        meets = entry <= leave
        begin = np.where(meets, entry, 0.0) - BACK
        return np.concatenate([starts + begin[:, None] * directions, directions], axis=1), begin, meets

    def _plane_depth(
        self,
        positions: Float[np.ndarray, "k 3"],
        directions: Float[np.ndarray, "k 3"],
        face: Int[np.ndarray, "k"],
        depth: Float[np.ndarray, "k"],
    ) -> Float[np.ndarray, "k"]:
        """Depth on each ray's triangle's plane in float64, but float32's `depth` where that is better conditioned."""
        normal, corner = self.normals[face], self.mesh.vertices[self.mesh.faces[face, 0]]
        slope = np.einsum("ij,ij->i", normal, directions)
        exact = np.einsum("ij,ij->i", normal, corner - positions) / np.where(slope == 0, 1.0, slope)
        close = np.abs(exact - depth) <= 1e-5 * (self.scale + np.abs(depth))  # float32 is; further is ill-posed
        return np.where((np.abs(slope) > 1e-3) & close, exact, depth)

    def _first_ahead(
        self,
        positions: Float[np.ndarray, "k 3"],
        directions: Float[np.ndarray, "k 3"],
        local: Float[np.ndarray, "k 6"],
        begin: Float[np.ndarray, "k"],
    ) -> tuple[Float[np.ndarray, "k"], Int[np.ndarray, "k"]]:
        """First hit at t >= 0 (float64) among all that float32 rays meet, which begin at `begin` in local units."""
        ray, face, reached = self.met(local)
        rough = (begin[ray] + reached) * self.scale
        depth = self._plane_depth(positions[ray], directions[ray], face, rough)
        ahead = depth >= 0
        ray, face, depth = ray[ahead], face[ahead], depth[ahead]
        order = np.lexsort((depth, ray))
        first = order[np.flatnonzero(np.diff(ray[order], prepend=-1))]
        found, triangle = np.full(len(positions), np.inf), np.full(len(positions), -1)
        found[ray[first]], triangle[ray[first]] = depth[first], face[first]
        return found, triangle

    def cast_local(self, local: Float[np.ndarray, "n 6"]) -> tuple[Float[np.ndarray, "n"], Int[np.ndarray, "n"]]:
        """Depth and triangle of float32 rays (position, direction) in local coordinates, `inf` and -1 on a miss."""
        if len(self.kept) == 0 or len(local) == 0:
            return np.full(len(local), np.inf, dtype=np.float32), np.full(len(local), -1)
        depth, kept, _ = self.cast_kept(local)
        return depth, np.where(np.isfinite(depth), self.kept.take(kept, mode="clip"), -1)

    def cast_kept(
        self, local: Float[np.ndarray, "n 6"]
    ) -> tuple[Float[np.ndarray, "n"], UInt[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
        """As Open3D answers: depth, index into `kept` (above every index on a miss) and the triangle's normal by the
        order of its corners (zero on a miss), float32.

        The scene must have a triangle with an area.
        """
        answer = self._scene.cast_rays(_tensor(local, copied=False))
        return answer["t_hit"].numpy(), answer["primitive_ids"].numpy(), answer["primitive_normals"].numpy()

    def blocked_local(
        self, positions: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> Bool[np.ndarray, "n"]:
        """Whether float32 rays in local coordinates meet anything (faster than finding what)."""
        stacked = np.concatenate([positions, directions], axis=1).astype(np.float32)
        return self._scene.test_occlusions(_tensor(stacked)).numpy()

    def met_along(
        self, starts: Float[np.ndarray, "n 3"], ends: Float[np.ndarray, "n 3"]
    ) -> tuple[Int[np.ndarray, "k"], Int[np.ndarray, "k"]]:
        """Segment and triangle of all that segments in local coordinates meet, in float32."""
        if len(self.kept) == 0 or len(starts) == 0:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        stacked = np.concatenate([starts, ends - starts], axis=1).astype(np.float32)
        segment, face, reached = self.met(stacked)
        return segment[reached <= 1.0], face[reached <= 1.0]

    def met(
        self, local: Float[np.ndarray, "b 6"]
    ) -> tuple[Int[np.ndarray, "k"], Int[np.ndarray, "k"], Float[np.ndarray, "k"]]:
        """Ray, triangle and depth (float32) of all that float32 rays in local coordinates meet."""
        found = self._scene.list_intersections(_tensor(local))
        ray, kept = (found[name].numpy().astype(np.int64) for name in ("ray_ids", "primitive_ids"))
        return ray, self.kept[kept], found["t_hit"].numpy()

    def distance(self, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Unsigned distance to the surface, in the mesh's unit: nearest triangle by Open3D, its distance in float64."""
        local = self.local(positions)
        answer = self._scene.compute_closest_points(_tensor(local.astype(np.float32)))
        face = self.kept[answer["primitive_ids"].numpy().astype(np.int64)]
        return distance_to_triangles(np.asarray(positions, dtype=np.float64), self.mesh.triangles[face])

    def closest(self, positions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """The closest points of the surface, in the mesh's frame; float32 of half the longest side."""
        answer = self._scene.compute_closest_points(_tensor(self.local(positions).astype(np.float32)))
        return self.scale * answer["points"].numpy().astype(np.float64) + self.centre

    def outside(self, positions: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Whether points lie outside a closed mesh (parity of crossings along three rays, by majority)."""
        query = _tensor(self.local(positions).astype(np.float32))
        return self._scene.compute_occupancy(query, nsamples=3).numpy() < 0.5


@functools.cache
def _open3d() -> Any:
    """Open3D, or the `InputError` that says what to install."""
    with extras.named():
        import open3d

    return open3d


def _tensor(values: np.ndarray, copied: bool = True) -> Any:
    tensor = _open3d().core.Tensor
    return tensor(values) if copied else tensor.from_numpy(values)


def distance_to_triangles(
    points: Float[np.ndarray, "n 3"], corners: Float[np.ndarray, "n 3 3"]
) -> Float[np.ndarray, "n"]:
    """Distance of each point to its own triangle: the least over its plane (if the foot lies inside) and its edges."""
    starts, edges = corners, np.roll(corners, -1, axis=1) - corners
    to_point = points[:, None] - starts
    length_sq = (edges**2).sum(-1)
    along = np.clip((to_point * edges).sum(-1) / np.where(length_sq > 0, length_sq, 1.0), 0.0, 1.0)
    to_edge_sq = ((to_point - along[..., None] * edges) ** 2).sum(-1).min(axis=1)
    normal = np.cross(edges[:, 0], edges[:, 1])
    inside = (np.einsum("nij,nij->ni", np.cross(normal[:, None], edges), to_point) >= 0).all(axis=1)
    norm = np.linalg.norm(normal, axis=1)
    to_plane = np.abs(np.einsum("ij,ij->i", normal, to_point[:, 0])) / np.where(norm > 0, norm, 1.0)
    return np.where(inside & (norm > 0), to_plane, np.sqrt(to_edge_sq))


def cast(scene: Scene | Mesh, points: rays.OrientedPoints[Array]) -> rays.RayHits[Array]:
    """What each oriented point sees first, in the mesh's own frame, in the library of the points.

    Depth and normals are float64.

    The triangle comes from Open3D (float32, no leaks through edges); the depth is then solved on that triangle's plane
    in float64, except at grazing incidence, where float32 is better conditioned than the plane.
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


def cast_exact(mesh: Mesh, points: rays.OrientedPoints[Array]) -> rays.RayHits[Array]:
    """The same by brute force: every ray against every triangle (`meet`). Slow; the reference for tests."""
    scene = Scene(mesh)
    positions, directions = flat(points.positions), flat(points.directions)
    depth, face = np.full(len(positions), np.inf), np.full(len(positions), -1)
    corners = mesh.triangles[scene.kept]
    for i in range(len(positions) if len(corners) else 0):
        start, along = (np.broadcast_to(values[i], (len(corners), 3)) for values in (positions, directions))
        t = meet(start, along, corners)
        nearest = int(np.argmin(t))
        if np.isfinite(t[nearest]):
            depth[i], face[i] = t[nearest], scene.kept[nearest]
    return hits(scene, directions, depth, face, points.positions)


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


# Where one ray meets one triangle. Source: Woop et al. 2013, "Watertight ray/triangle intersection": sheared edge
# functions, whose signs agree between the triangles of an edge; zero counts as inside, so no ray slips between two
# triangles. Each comes with a bound of its rounding; a pair whose answer the bound leaves open is computed again in
# rational numbers (Shewchuk 1997 calls the idea a filter).


def meet(
    positions: Float[np.ndarray, "k 3"], directions: Float[np.ndarray, "k 3"], triangles: Float[np.ndarray, "k 3 3"]
) -> Float[np.ndarray, "k"]:
    """Depth t >= 0 of each ray on its own triangle, in lengths of its direction; `inf` where it passes by, lies in the
    plane, or leaves it behind.
    """
    depth, inside, unsure = _filtered(positions, directions, triangles)
    found = np.where(inside & (depth >= 0), depth, np.inf)
    for i in np.flatnonzero(unsure):
        found[i] = _rational(positions[i].tolist(), directions[i].tolist(), triangles[i].tolist())
    return found


def _filtered(
    positions: Float[np.ndarray, "k 3"], directions: Float[np.ndarray, "k 3"], triangles: Float[np.ndarray, "k 3 3"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Depth on the plane, whether the ray passes inside, and whether rounding leaves either open."""
    corners = triangles - positions[:, None]
    z = np.argmax(np.abs(directions), axis=1)[:, None]
    dx, dy, dz = (np.take_along_axis(directions, (z + i) % 3, axis=1) for i in (1, 2, 0))
    cx, cy, cz = (np.take_along_axis(corners, ((z + i) % 3)[:, None], axis=2)[..., 0] for i in (1, 2, 0))
    px, py = cx - (dx / dz) * cz, cy - (dy / dz) * cz
    nx, ny = np.roll(px, -1, axis=1), np.roll(py, -1, axis=1)
    edges = np.roll(px * ny - py * nx, -1, axis=1)  # edge function opposite to each corner
    total = edges.sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (edges * cz).sum(axis=1) / total / dz[:, 0]
    largest = np.abs(corners).max(axis=(1, 2))
    slack = _ROUNDINGS * _EPSILON * np.maximum(np.abs(px), np.abs(py)).max(axis=1) * largest
    least, most = edges.min(axis=1), edges.max(axis=1)
    inside = ((least >= 0) | (most <= 0)) & (total != 0)
    beside = (least < -slack) & (most > slack)  # both signs, surely
    spread = cz.max(axis=1) - cz.min(axis=1) + _EPSILON * largest
    with np.errstate(divide="ignore", invalid="ignore"):
        off = slack / np.abs(total) * spread / np.abs(dz[:, 0])
        poor = ~(off <= _DEPTH * np.abs(depth))
    on_edge = np.abs(edges).min(axis=1) <= slack
    return depth, inside, ~beside & (on_edge | (inside & poor))


def _rational(position: list[float], direction: list[float], triangle: list[list[float]]) -> float:
    """`meet` of one pair without rounding, until the depth is made a float.

    a, b, c: corners seen from the start. v·(b x c) and its two sisters tell the sides, their sum v·n the slope, and
    t = a·(b x c) / v·n.
    """
    start, v = ([Fraction(x) for x in vector] for vector in (position, direction))
    a, b, c = ([Fraction(x) - s for x, s in zip(corner, start, strict=True)] for corner in triangle)
    bc = _cross(b, c)
    sides = [_dot(v, bc), _dot(v, _cross(c, a)), _dot(v, _cross(a, b))]
    slope = sum(sides)
    if slope == 0 or (min(sides) < 0 < max(sides)):
        return float("inf")
    depth = _dot(a, bc) / slope
    return float(depth) if depth >= 0 else float("inf")


def _cross(a: list[Fraction], b: list[Fraction]) -> list[Fraction]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))

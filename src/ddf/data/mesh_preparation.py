"""From any triangle soup to a small, normalised mesh, closed unless told otherwise, and what that lost.

clean -> close (alpha wrap) -> decimate -> field frame, each in float64 and in coordinates centred at 0, so that a mesh
far from its origin loses nothing. A wrap follows the outside only: sheets get a thickness of twice the offset, holes
narrower than alpha are closed, and everything hidden inside disappears. `measure` says how far that moved the surface.
Lengths in `MeshesConfig` and in the measures are relative to the diagonal of the raw mesh's box.
"""

import functools
import time
from dataclasses import dataclass

import fast_simplification
import numpy as np
import pymeshlab
from jaxtyping import Float, Int
from scipy import sparse, spatial

from ddf.core import checks
from ddf.data.mesh_config import MeshesConfig
from ddf.geometry import raycast, transforms
from ddf.geometry.mesh_io import Mesh, face_normals

LOSSES = ("hausdorff", "mean_distance", "hausdorff_hidden", "lost")  # as `measure` gives them
_WELD_TOLERANCE = 1e-5  # of the diagonal: float32 noise of seams in STL files reaches 4e-6, real detail starts at 1e-4


@dataclass(frozen=True)
class Prepared:
    """A mesh in the field frame, closed unless `wrap` is "never", the map that led there and what was lost."""

    mesh: Mesh
    field_from_raw: transforms.Similarity
    watertight: bool
    wrapped: bool
    hausdorff: float
    mean_distance: float
    hausdorff_hidden: float
    lost: float
    seconds: float


def clean(mesh: Mesh) -> Mesh:
    """Weld equal vertices, drop degenerate and repeated triangles and vertices that nothing uses.

    Vertices within 1e-5 of the diagonal are welded as well where (and only where) that closes the mesh.

    Raises:
      InputError: no triangle with an area is left.
    """
    exact = _without_repeats(_weld(mesh, 0.0))
    if len(exact.faces) == 0:
        raise checks.InputError("no triangle has an area: nothing to close")
    if not is_watertight(exact):
        tolerant = _without_repeats(_weld(exact, _WELD_TOLERANCE * exact.diagonal()))
        if len(tolerant.faces) and is_watertight(tolerant):
            return tolerant
    return exact


def _weld(mesh: Mesh, tolerance: float) -> Mesh:
    """One vertex, the first, in place of all that are equal or joined by steps no longer than the tolerance."""
    if tolerance > 0:
        pairs = spatial.cKDTree(mesh.vertices).query_pairs(tolerance, output_type="ndarray")
        label = _components(pairs, len(mesh.vertices))
    else:
        keys = np.ascontiguousarray(mesh.vertices + 0.0)  # -0.0 becomes 0.0, which is equal but has other bytes
        label = np.unique(keys.view(f"V{3 * keys.itemsize}").ravel(), return_inverse=True)[1].reshape(-1)
    _, first, label = np.unique(label, return_index=True, return_inverse=True)
    return Mesh(mesh.vertices[first], label.reshape(-1)[mesh.faces])


def _components(pairs: Int[np.ndarray, "k 2"], count: int) -> Int[np.ndarray, "count"]:
    """Component of every node of a graph given by its edges."""
    graph = sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return sparse.csgraph.connected_components(graph, directed=False)[1]


def _without_repeats(mesh: Mesh) -> Mesh:
    _, areas = face_normals(mesh)
    edges = mesh.triangles - np.roll(mesh.triangles, 1, axis=1)
    longest_sq = (edges**2).sum(-1).max(axis=1, initial=0.0)
    good = mesh.faces[areas > 1e-14 * longest_sq]  # a flatter triangle has no normal that float64 can give
    _, first = np.unique(np.sort(good, axis=1), axis=0, return_index=True)
    kept = good[np.sort(first)]
    used, faces = np.unique(kept, return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3))


def _edges(faces: Int[np.ndarray, "m 3"]) -> Int[np.ndarray, "k 2"]:
    return faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)


def is_watertight(mesh: Mesh) -> bool:
    """True if the mesh is closed and consistently wound: every edge has two triangles, that run along it both ways."""
    if len(mesh.faces) == 0:
        return False
    edges, n = _edges(mesh.faces), len(mesh.vertices)
    forward, backward = np.sort(edges[:, 0] * n + edges[:, 1]), np.sort(edges[:, 1] * n + edges[:, 0])
    return bool((np.diff(forward) > 0).all() and (forward == backward).all())


def has_manifold_vertices(mesh: Mesh) -> bool:
    """True if, at every vertex of a closed mesh, the triangles form one fan (no two cones touching at their tips)."""
    m = len(mesh.faces)
    edges, face = _edges(mesh.faces), np.repeat(np.arange(m), 3)
    n = len(mesh.vertices)
    order = np.argsort(edges.min(axis=1) * n + edges.max(axis=1), kind="stable")
    left, right = order[::2], order[1::2]
    corner = np.arange(3 * m)  # of (face, local vertex): 3 face + local; edge k of a face starts at its corner k
    start, stop = corner, 3 * face + (corner % 3 + 1) % 3
    same_way = edges[left, 0] == edges[right, 0]
    pairs_a = np.concatenate([start[left], stop[left]])
    near, far = np.where(same_way, [start[right], stop[right]], [stop[right], start[right]])
    pairs_b = np.concatenate([near, far])
    fan = _components(np.stack([pairs_a, pairs_b], axis=1), 3 * m)
    return bool(fan.max() + 1 == len(np.unique(mesh.faces)))


def _to_meshlab(mesh: Mesh) -> pymeshlab.MeshSet:
    work = pymeshlab.MeshSet(verbose=False)
    work.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    return work


def _from_meshlab(work: pymeshlab.MeshSet) -> Mesh:
    current = work.current_mesh()
    return Mesh(current.vertex_matrix(), current.face_matrix())


def _is_clean_solid(mesh: Mesh) -> bool:
    """One closed piece, right side out or inside out, that nowhere meets itself."""
    if not (is_watertight(mesh) and has_manifold_vertices(mesh)):
        return False
    if _components(_edges(mesh.faces), len(mesh.vertices)).max() > 0:
        return False
    work = _to_meshlab(mesh)
    work.compute_selection_by_self_intersections_per_face()
    return work.current_mesh().selected_face_number() == 0


def close(mesh: Mesh, alpha: float, offset: float) -> Mesh:
    """The outside of a triangle soup as one closed manifold. Source: CGAL's alpha wrap (Portaneri et al. 2022).

    Args:
      mesh: cleaned; coordinates of order 1.
      alpha, offset: in units of the diagonal of the mesh's box.
    Raises:
      InputError: the wrap is not closed, or leaves a part of the mesh outside.
    """
    soup = Mesh(mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    work = _to_meshlab(soup)  # MeshLab drops triangles that run along a shared edge the wrong way: so share none
    percent = pymeshlab.PercentageValue
    work.generate_alpha_wrap(alpha=percent(100 * alpha), offset=percent(100 * offset))
    wrap = _from_meshlab(work)
    if not is_watertight(wrap):
        raise checks.InputError("the wrap is not closed; try another alpha")
    probes, scene = np.concatenate([mesh.vertices, mesh.triangles.mean(axis=1)]), raycast.Scene(wrap)
    left_out = probes[scene.outside(probes)]
    if len(left_out) and scene.distance(left_out).max() > 0.1 * offset * mesh.diagonal():
        raise checks.InputError("the wrap leaves a part of the mesh outside; try another alpha")
    return wrap


def _outward(mesh: Mesh) -> Mesh:
    corners = mesh.triangles
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum()
    return mesh if volume >= 0 else Mesh(mesh.vertices, mesh.faces[:, ::-1])


def decimate(mesh: Mesh, faces: int) -> Mesh:
    """Reduce a mesh to at most `faces` triangles by quadric edge collapse; a closed manifold stays one.

    fast-simplification where its result is still closed, otherwise MeshLab's collapse that preserves topology. A mesh
    that is open to begin with is left to fast-simplification.

    Raises:
      InputError: the topology (many handles) needs more triangles than `faces`.
    """
    if len(mesh.faces) <= faces:
        return mesh
    closed = is_watertight(mesh)
    points, triangles = fast_simplification.simplify(
        np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces, dtype=np.int32), target_count=faces
    )
    quick = _without_unused(Mesh(points, triangles))
    if len(quick.faces) <= faces and (not closed or (is_watertight(quick) and has_manifold_vertices(quick))):
        return quick
    work = _to_meshlab(mesh)
    work.meshing_decimation_quadric_edge_collapse(
        targetfacenum=faces, preservetopology=True, preservenormal=True, planarquadric=True
    )
    slow = _without_unused(_from_meshlab(work))
    if len(slow.faces) > faces or is_watertight(slow) < closed:
        raise checks.InputError(f"cannot reach {faces} triangles and stay closed; got {len(slow.faces)}: raise faces")
    return slow


def _without_unused(mesh: Mesh) -> Mesh:
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3))


@dataclass(frozen=True)
class Surface:
    """Triangles ready for drawing points uniform by area; those without an area get none.

    Raises:
      InputError: no triangle has an area.
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


def sample_surface(
    mesh: Mesh, count: int, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "count 3"], Int[np.ndarray, "count"]]:
    """As `Surface.draw`, of a mesh that is drawn from once."""
    return Surface.of(mesh).draw(count, rng)


def measure(raw: Mesh, result: Mesh, points: int, rng: np.random.Generator) -> dict[str, float]:
    """How far the surfaces of two meshes of one frame lie apart, in units of the raw box's diagonal.

    Both ways, from `points` points by area (and all vertices of the result) to the nearest point of the other surface;
    Open3D picks the nearest triangle in float32, which long slivers can mislead by 2e-4. Raw points that cannot be seen
    from outside are left out, because a wrap drops them on purpose, and given as a figure of their own.

    Returns:
      `hausdorff`: largest distance of both ways. `mean_distance`: mean of the means of both ways.
      `hausdorff_hidden`: largest distance from a hidden raw point; 0 without any.
      `lost`: largest distance from a raw point that lies outside the result (a part cut off, not one smoothed over);
      an open result has no inside.
    """
    diagonal = raw.diagonal()
    raw_scene, result_scene = raycast.Scene(raw), raycast.Scene(result)
    raw_points, raw_faces = sample_surface(raw, points, rng)
    result_points, _ = sample_surface(result, points, rng)
    hidden = ~raycast.visible_from_outside(raw_scene, raw_points, raw_faces)
    there = result_scene.distance(raw_points) / diagonal
    outside = result_scene.outside(raw_points) if is_watertight(result) else np.ones(len(raw_points), dtype=bool)
    back = raw_scene.distance(np.concatenate([result_points, result.vertices])) / diagonal
    seen = there[~hidden] if (~hidden).any() else there
    return {
        "hausdorff": float(max(seen.max(), back.max())),
        "mean_distance": float(0.5 * (seen.mean() + back[:points].mean())),
        "hausdorff_hidden": float(there[hidden].max(initial=0.0)),
        "lost": float(there[outside].max(initial=0.0)),
    }


def prepare(raw: Mesh, config: MeshesConfig, rng: np.random.Generator) -> Prepared:
    """Clean, close (unless `wrap` is "never"), decimate and normalise one mesh, and measure the loss.

    A mesh that was neither closed nor decimated has lost nothing: no point of it is asked for.

    Raises:
      InputError: nothing to close, or the result cannot be both closed and small enough.
    """
    begin = time.perf_counter()
    unit_from_raw = transforms.field_from_mesh(raw.vertices[np.unique(raw.faces)])
    unit = clean(Mesh(unit_from_raw.apply(raw.vertices), raw.faces))
    wrapped = config.wrap == "always" or (config.wrap == "auto" and not _is_clean_solid(unit))
    solid = close(unit, config.alpha, config.offset) if wrapped else unit
    small = decimate(_outward(solid) if config.wrap != "never" else solid, config.faces)
    as_it_was = not wrapped and len(small.faces) == len(unit.faces)  # at most turned inside out
    losses = dict.fromkeys(LOSSES, 0.0) if as_it_was else measure(unit, small, config.measure_points, rng)
    field_from_unit = transforms.field_from_mesh(small.vertices)
    mesh = Mesh(field_from_unit.apply(small.vertices), small.faces)
    return Prepared(
        mesh=mesh,
        field_from_raw=field_from_unit.compose(unit_from_raw),
        watertight=is_watertight(mesh),
        wrapped=wrapped,
        seconds=time.perf_counter() - begin,
        **losses,
    )

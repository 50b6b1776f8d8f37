"""The bodies that triangles form: welding, closedness, pieces, openings, and whether a mesh may be kept as it is.

Every decision is the same at any scale and place, and under a rounding far below the weld tolerance. A mesh passes
through itself where an edge pierces a triangle by more than a tolerance, on both sides of the triangle and from its
border; contact is no crossing. Open3D proposes crossings (in float32), float64 decides.
"""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import sparse, spatial

from ddf.core import checks
from ddf.geometry import raycast
from ddf.geometry.formats import polygons
from ddf.geometry.mesh_io import Mesh, face_normals, have_area

TOLERANCE = 1e-5  # of the diagonal: float32 noise of seams in STL files reaches 4e-6, real detail starts at 1e-4
_BLOCK = 1 << 16  # edges at once: each meets a few triangles along its line


def pierced(mesh: Mesh) -> Int[np.ndarray, "k 2"]:
    """Edges (by their vertices) that pierce a triangle, as pairs of vertices, one row per piercing; of a mesh of which
    every triangle has an area.
    """
    scene = raycast.Scene(mesh)
    edges = np.unique(np.sort(_edges(mesh.faces), axis=1), axis=0)
    local, least = scene.local(mesh.vertices), TOLERANCE * mesh.diagonal() / scene.scale
    found = []
    for block in np.split(edges, range(_BLOCK, len(edges), _BLOCK)):
        edge, face = scene.met_along(*mesh.vertices[block.T])
        found.append(block[_deep(local, mesh.faces, block, edge, face, least)])
    return np.concatenate(found)


def _deep(
    vertices: Float[np.ndarray, "n 3"],
    faces: Int[np.ndarray, "m 3"],
    edges: Int[np.ndarray, "e 2"],
    edge: Int[np.ndarray, "h"],
    face: Int[np.ndarray, "h"],
    least: float,
) -> Int[np.ndarray, "k"]:
    """Of proposed pairs of an edge and a triangle the edges of those that cross by more than `least`."""
    apart = (faces[face][:, :, None] != edges[edge][:, None, :]).all(axis=(1, 2))
    edge, face = edge[apart], face[apart]
    corners, ends = vertices[faces[face]], vertices[edges[edge]]
    sides = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(sides[:, 0], sides[:, 1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    height = np.einsum("hej,hj->he", ends - corners[:, :1], normal)
    through = (height.prod(axis=1) < 0) & (np.abs(height).min(axis=1) > least)
    edge, corners, ends, sides, normal, height = (
        values[through] for values in (edge, corners, ends, sides, normal, height)
    )
    share = height[:, 0] / (height[:, 0] - height[:, 1])
    point = ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0])
    inwards = np.cross(normal[:, None], sides)
    inwards /= np.linalg.norm(sides, axis=2)[..., None]
    within = np.einsum("hij,hij->hi", point[:, None] - corners, inwards).min(axis=1)
    return edge[within > least]


_MOST_PIECES = 1000  # more are a soup; and twice as many pairs whose boxes meet


def clean(mesh: Mesh) -> Mesh:
    """Weld equal vertices, drop degenerate and repeated triangles and vertices that nothing uses.

    Where (and only where) that closes the mesh, vertices within 1e-5 of the diagonal are welded as well. Where it
    gives a mesh that is sound, triangles without an area stay, which fill the seams of CAD files, and of triangles back
    to back both go. InputError where no triangle with an area is left.
    """
    welded = _weld(mesh, 0.0)
    exact = _without_repeats(welded)
    if len(exact.faces) == 0:
        raise checks.InputError("no triangle has an area: nothing to close")
    if is_watertight(exact):
        return exact
    tolerant = _weld(exact, TOLERANCE * exact.diagonal())
    closed = _without_repeats(tolerant)
    if len(closed.faces) and is_watertight(closed):
        return closed
    candidates = (_cancelled(mesh) for mesh in (welded, tolerant))
    return next((candidate for candidate in candidates if len(candidate.faces) and is_sound(candidate)), exact)


def _cancelled(mesh: Mesh) -> Mesh:
    """Without triangles that use a vertex twice, and without pairs of the same corners that face opposite ways."""
    first, second, third = mesh.faces.T
    faces = mesh.faces[(first != second) & (second != third) & (third != first)]
    if len(faces) == 0:
        return Mesh(mesh.vertices, faces)
    turned = np.argmin(faces, axis=1)
    rolled = np.take_along_axis(faces, (turned[:, None] + np.arange(3)) % 3, axis=1)
    forward = rolled[:, 1] < rolled[:, 2]
    _, label = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)
    label = label.reshape(-1)
    balance = np.bincount(label, np.where(forward, 1, -1))
    kept = faces[(balance[label] == np.where(forward, 1, -1))]
    return without_unused(Mesh(mesh.vertices, kept))


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
    good = mesh.faces[have_area(mesh, areas)]
    _, first = np.unique(np.sort(good, axis=1), axis=0, return_index=True)
    kept = good[np.sort(first)]
    return without_unused(Mesh(mesh.vertices, kept))


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


def components(mesh: Mesh) -> Int[np.ndarray, "n"]:
    """Piece that every vertex belongs to."""
    return _components(_edges(mesh.faces), len(mesh.vertices))


def volumes(mesh: Mesh) -> Float[np.ndarray, "pieces"]:
    """Signed volume of every piece of a closed mesh, positive if its triangles face outwards."""
    corners = mesh.triangles - (mesh.vertices[mesh.faces[0, 0]] if len(mesh.faces) else 0.0)
    six = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return np.bincount(components(mesh)[mesh.faces[:, 0]], six) / 6


def outward(mesh: Mesh) -> Mesh:
    """The mesh with the pieces turned that face inwards, and with each all that lies inside it; where pieces touch or
    are too many to be told apart all together, or none.
    """
    volume, inside = volumes(mesh), nesting(mesh)
    if inside is None:
        return mesh if volume.sum() >= 0 else Mesh(mesh.vertices, mesh.faces[:, ::-1])
    inwards = (volume < 0)[_outermost(inside)][components(mesh)[mesh.faces[:, 0]]]
    return Mesh(mesh.vertices, np.where(inwards[:, None], mesh.faces[:, ::-1], mesh.faces))


def is_sound(mesh: Mesh) -> bool:
    """Closed pieces, right side out or inside out, that pass neither through themselves nor through each other and
    nowhere touch. What lies inside a piece is the wall of a cavity or lies in one: it faces the other way each time.
    """
    if not (is_watertight(mesh) and has_manifold_vertices(mesh)):
        return False
    inside, inwards = nesting(mesh), volumes(mesh) < 0
    if inside is None or ((inwards ^ inwards[_outermost(inside)]) != (inside.sum(axis=1) % 2 == 1)).any():
        return False
    return len(pierced(mesh)) == 0


def _outermost(inside: Bool[np.ndarray, "n n"]) -> Int[np.ndarray, "n"]:
    """Of every piece the one around it that lies in no other; itself where it lies in none."""
    free = ~inside.any(axis=1)
    return np.where(free, np.arange(len(inside)), np.argmax(inside & free, axis=1))


def nesting(mesh: Mesh) -> Bool[np.ndarray, "pieces pieces"] | None:
    """Which piece of a closed mesh (row) lies inside which (column), of pieces that do not cross; None where two are
    nearer than the weld tolerance, or the boxes of too many meet.

    Pieces whose boxes lie apart are not looked at. Of others the vertices and points on the edges are measured.
    """
    label = components(mesh)
    count = int(label.max()) + 1
    inside = np.zeros((count, count), dtype=bool)
    if count > _MOST_PIECES:
        return None
    lower, upper = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(lower, label, mesh.vertices)
    np.maximum.at(upper, label, mesh.vertices)
    least = TOLERANCE * mesh.diagonal()
    gap = np.maximum(lower[:, None] - upper[None], lower[None] - upper[:, None]).max(axis=-1)
    np.fill_diagonal(gap, np.inf)
    pairs = np.argwhere(gap <= least)
    if len(pairs) > 2 * _MOST_PIECES:
        return None
    pieces = {
        i: without_unused(Mesh(mesh.vertices, mesh.faces[label[mesh.faces[:, 0]] == i])) for i in np.unique(pairs)
    }
    scenes = {i: raycast.Scene(piece) for i, piece in pieces.items()}
    probes = {i: _along_edges(piece) for i, piece in pieces.items()}
    for one, other in pairs:
        points = probes[one]
        near = ((points >= lower[other] - least) & (points <= upper[other] + least)).all(axis=1)
        if near.any() and scenes[other].distance(points[near]).min() <= least:
            return None
        inside[one, other] = bool(near.all() and not scenes[other].outside(points[:1])[0])
    return inside


def _along_edges(mesh: Mesh) -> Float[np.ndarray, "k 3"]:
    """The vertices, and points at eighths of the edges."""
    starts, stops = mesh.vertices[np.unique(np.sort(_edges(mesh.faces), axis=1), axis=0)].transpose(1, 0, 2)
    return np.concatenate([mesh.vertices, *(starts + share * (stops - starts) for share in np.arange(1, 8) / 8)])


def without_unused(mesh: Mesh) -> Mesh:
    """Only the vertices that triangles use."""
    used, faces = np.unique(mesh.faces, return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3))


def opening_loops(mesh: Mesh) -> list[Int[np.ndarray, "k"]]:
    """Vertices around every opening, in the order that its filling needs; tangled borders give what loops they have."""
    edges = _edges(mesh.faces)
    n = len(mesh.vertices)
    keys, count = np.unique(edges.min(axis=1) * n + edges.max(axis=1), return_counts=True)
    border = edges[np.isin(edges.min(axis=1) * n + edges.max(axis=1), keys[count == 1])]
    after: dict[int, list[int]] = {}
    for start, stop in border[:, ::-1].tolist():  # the filling runs along the border the other way
        after.setdefault(start, []).append(stop)
    found = []
    while after:
        path = [next(iter(after))]
        place = {path[0]: 0}
        while path[-1] in after:
            ahead = after[path[-1]].pop()
            if not after[path[-1]]:
                del after[path[-1]]
            if ahead in place:
                begin = place[ahead]
                if len(path) - begin >= 3:
                    found.append(np.array(path[begin:]))
                for vertex in path[begin + 1 :]:
                    del place[vertex]
                path = path[: begin + 1]
            else:
                place[ahead] = len(path)
                path.append(ahead)
    return found


def entered_openings(mesh: Mesh, wrap: Mesh) -> list[float]:
    """Widths, diagonals of their boxes as shares of the mesh's, of the openings that a closed wrap of the mesh goes
    through: what lies behind them is a shell.
    """
    found = opening_loops(mesh)
    if not found:
        return []
    through = raycast.Scene(wrap).outside(np.stack([mesh.vertices[loop].mean(axis=0) for loop in found]))
    return [
        float(np.linalg.norm(np.ptp(mesh.vertices[loop], axis=0)) / mesh.diagonal())
        for loop, out in zip(found, through, strict=True)
        if out
    ]


def fill_openings(mesh: Mesh) -> tuple[Mesh, int]:
    """The mesh with its openings filled, and how many they are.

    An opening is cut into triangles in the plane of its area vector; where its border crosses itself there, triangles
    to the mean of its corners fill it.
    """
    vertices: list[Float[np.ndarray, "n 3"]] = [mesh.vertices]
    faces: list[Int[np.ndarray, "m 3"]] = [mesh.faces]
    added, loops = len(mesh.vertices), opening_loops(mesh)
    for loop in loops:
        cut = polygons.cut(mesh.vertices[loop]) if len(loop) <= polygons.MAX_CORNERS // 10 else None
        if cut is None:
            vertices.append(mesh.vertices[loop].mean(axis=0)[None])
            faces.append(np.stack([loop, np.roll(loop, -1), np.full(len(loop), added)], axis=1))
            added += 1
        else:
            faces.append(loop[cut])
    return Mesh(np.concatenate(vertices), np.concatenate(faces)), len(loops)

"""Openings of a mesh: the loops of edges that have one triangle, and surfaces that fill them."""

import numpy as np
from jaxtyping import Float, Int

from ddf.geometry import raycast
from ddf.geometry.formats import polygons
from ddf.geometry.mesh_io import Mesh


def loops(mesh: Mesh) -> list[Int[np.ndarray, "k"]]:
    """Vertices around every opening, in the order that its filling needs; tangled borders give what loops they have."""
    edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
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


def width(mesh: Mesh, loop: Int[np.ndarray, "k"]) -> float:
    """Diagonal of the box of an opening, as a share of the mesh's."""
    corners = mesh.vertices[loop]
    return float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0)) / mesh.diagonal())


def entered(mesh: Mesh, wrap: Mesh) -> list[float]:
    """Widths of the openings that a closed wrap of the mesh goes through: what lies behind them is a shell."""
    found = loops(mesh)
    if not found:
        return []
    through = raycast.Scene(wrap).outside(np.stack([mesh.vertices[loop].mean(axis=0) for loop in found]))
    return [width(mesh, loop) for loop, out in zip(found, through, strict=True) if out]


def filled(mesh: Mesh, largest: float) -> tuple[Mesh, int]:
    """The mesh with its openings up to the width `largest` (share of the diagonal) filled, and how many they are.

    An opening is cut into triangles in the plane of its area vector; where its border crosses itself there, triangles
    to the mean of its corners fill it.
    """
    vertices: list[Float[np.ndarray, "n 3"]] = [mesh.vertices]
    faces: list[Int[np.ndarray, "m 3"]] = [mesh.faces]
    added, count = len(mesh.vertices), 0
    for loop in loops(mesh):
        if width(mesh, loop) > largest:
            continue
        count += 1
        cut = polygons.cut(mesh.vertices[loop]) if len(loop) <= polygons.MAX_CORNERS // 10 else None
        if cut is None:
            vertices.append(mesh.vertices[loop].mean(axis=0)[None])
            faces.append(np.stack([loop, np.roll(loop, -1), np.full(len(loop), added)], axis=1))
            added += 1
        else:
            faces.append(loop[cut])
    return Mesh(np.concatenate(vertices), np.concatenate(faces)), count

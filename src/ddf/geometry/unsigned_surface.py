"""A triangle mesh from unsigned distances and the directions v* of the closest point: surface nets over a grid.

A grid edge from a to b = a + h e crosses the surface where the closest points of its ends lie between them:
v*_a . e > 0 > v*_b . e, v*_a . v*_b < 0, and both distances together are about h or less. (Between two sheets v* turns
too, but away from the edge.) A crossing is at the share u_a / (u_a + u_b) of the edge. Each cell with crossings has a
vertex, their mean, moved onto the surface by one step u v*; each crossing joins the vertices of its four cells by a
quad. No sides are told apart, so open sheets stay open, and nothing has to be oriented. Derived here after surface
nets, S. F. F. Gibson 1998.

Distances change by no more than the way: blocks of the grid that lie farther from the surface than their own size are
never looked into.

`poisson` makes one through points with normals, by Open3D.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

from ddf.core import checks
from ddf.geometry.mesh_io import Mesh, told_origin

# positions (n, 3) -> distances (n), unit directions to the closest point (n, 3)
Distances = Callable[[Float[np.ndarray, "n 3"]], tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]]
BLOCK = 8  # cells a side of a block
_SLACK = 1.25  # both distances of an edge together, in cells: 1 for a plane across it, more for noise
_LEAST_DENSITY = 0.02  # quantile of the vertices' density below which they are cut off: the points do not support them


def extract(ask: Distances, lower: Float[np.ndarray, "3"], upper: Float[np.ndarray, "3"], resolution: int = 96) -> Mesh:
    """The surface within a box, of which the longest side has so many cells; InputError of less than 2, or where there
    is none.
    """
    if resolution < 2:
        raise checks.InputError(f"resolution must be >= 2; got {resolution}")
    cell = float((upper - lower).max()) / resolution
    count = np.ceil((upper - lower) / cell).astype(int) + 2 * BLOCK  # a margin, so that no crossing lies on the rim
    count = -(-count // BLOCK) * BLOCK
    origin = (lower + upper) / 2 - cell * count / 2
    blocks = BLOCK * np.stack(np.meshgrid(*map(np.arange, count // BLOCK), indexing="ij"), axis=-1).reshape(-1, 3)
    reach = (np.sqrt(3) * BLOCK / 2 + _SLACK) * cell
    blocks = blocks[ask(origin + cell * (blocks + BLOCK / 2))[0] <= reach]  # the surface may pass through or beside
    within = np.stack(np.meshgrid(*[np.arange(BLOCK + 1)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    nodes = np.unique((blocks[:, None] + within).reshape(-1, 3), axis=0)
    distances, ways = ask(origin + cell * nodes)
    place = np.full(np.prod(count + 1), -1)
    place[np.ravel_multi_index(tuple(nodes.T), tuple(count + 1))] = np.arange(len(nodes))
    place = place.reshape(count + 1)
    corners, quads = _crossings(nodes, place, distances, ways, cell, count)
    if not len(quads):
        raise checks.InputError("there is no surface in the box: fit the field for longer")
    vertices, faces = net(corners, quads, count)
    vertices = origin + cell * vertices
    left, way = ask(vertices)
    near = left < cell
    vertices[near] += left[near, None] * way[near]
    return Mesh(vertices, faces)


def _crossings(
    nodes: Int[np.ndarray, "m 3"],
    place: Int[np.ndarray, "x y z"],
    distances: Float[np.ndarray, "m"],
    ways: Float[np.ndarray, "m 3"],
    cell: float,
    count: Int[np.ndarray, "3"],
) -> tuple[Float[np.ndarray, "c 3"], Int[np.ndarray, "c 4 3"]]:
    """Where edges cross the surface, in cells from the origin, and the four cells around each such edge."""
    places, cells = [], []
    for axis in range(3):
        step = np.eye(3, dtype=int)[axis]
        inside = (nodes[:, axis] < count[axis]) & (np.delete(nodes, axis, 1) > 0).all(1)
        inside &= (np.delete(nodes, axis, 1) < np.delete(count, axis)).all(1)
        first = np.flatnonzero(inside)
        second = place[tuple((nodes[first] + step).T)]
        first, second = first[second >= 0], second[second >= 0]
        crossed = (ways[first, axis] >= 0) & (ways[second, axis] <= 0) & ((ways[first] * ways[second]).sum(-1) < 0)
        crossed &= distances[first] + distances[second] <= _SLACK * cell
        first, second = first[crossed], second[crossed]
        share = distances[first] / np.maximum(distances[first] + distances[second], 1e-12 * cell)
        places.append(nodes[first] + share[:, None] * step)
        one, other = (np.eye(3, dtype=int)[(axis + i) % 3] for i in (1, 2))
        around = np.stack([-one - other, -other, np.zeros(3, dtype=int), -one])
        cells.append(nodes[first][:, None] + around)
    return np.concatenate(places), np.concatenate(cells)


def net(
    corners: Float[np.ndarray, "c 3"], quads: Int[np.ndarray, "c 4 3"], count: Int[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]:
    """A vertex per cell, the mean of its crossings, and two triangles per crossing, along the shorter diagonal.

    Args:
      corners: places of the crossings. quads: the four cells around each, whose order the triangles keep. count: cells.
    """
    keys = np.ravel_multi_index(tuple(quads.reshape(-1, 3).T), tuple(count))
    _, index = np.unique(keys, return_inverse=True)
    number = np.bincount(index)
    total = [np.bincount(index, weights=np.repeat(column, 4)) for column in corners.T]
    vertices = np.stack(total, axis=-1) / number[:, None]
    a, b, c, d = index.reshape(-1, 4).T
    straight = np.linalg.norm(vertices[a] - vertices[c], axis=1) <= np.linalg.norm(vertices[b] - vertices[d], axis=1)
    pairs = np.where(straight[:, None], np.stack([a, b, c, a, c, d], 1), np.stack([b, c, d, b, d, a], 1))
    return vertices, pairs.reshape(-1, 3)


def poisson(points: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], depth: int = 7) -> Mesh:
    """The surface through the points, in their frame, by Open3D; open where there are none.

    Source: Kazhdan and Hoppe 2013, screened Poisson reconstruction.

    Args:
      normals: outward, unit. depth: of the octree; details are about the box over 2^depth.
    """
    import open3d as o3d

    origin = told_origin(points)
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points - origin))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    mesh, density = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=depth, n_threads=1)
    density = np.asarray(density)
    mesh.remove_vertices_by_mask(density < np.quantile(density, _LEAST_DENSITY))
    return Mesh(np.asarray(mesh.vertices) + origin, np.asarray(mesh.triangles))

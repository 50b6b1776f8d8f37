"""Triangles whose sides nobody told: small openings closed, and all of a sheet turned one way.

Two triangles with a common edge agree where they go along it in opposite directions. Sides spread along a tree of such
edges, over the flattest ones first (Hoppe et al. 1992): where a sheet has one side alone, as a Möbius strip, it is cut.
The outer side is that with which a sheet's volume about its middle is positive: outside of a closed sheet, the bulging
side of an open one.
"""

import itertools

import numpy as np
from jaxtyping import Int
from scipy import sparse
from scipy.sparse import csgraph

from ddf.data import mesh_topology
from ddf.geometry import mesh_io

SMALL = 8  # edges of an opening that is closed: a few cells of a grid


def told(mesh: mesh_io.Mesh) -> mesh_io.Mesh:
    """The mesh without small openings, corners anticlockwise as seen from outside of each sheet. An edge of three
    triangles or more joins none.
    """
    turned = _turned_out(mesh)
    return mesh_io.Mesh(mesh.vertices, np.concatenate([turned.faces, _lids(turned)]), mesh.remarks)


def _turned_out(mesh: mesh_io.Mesh) -> mesh_io.Mesh:
    """The sides of the triangles that there are."""
    faces, count = mesh.faces, len(mesh.faces)
    edges = np.concatenate([np.roll(faces, -side, axis=1)[:, :2] for side in range(3)])  # an edge's triangle: modulo m
    unit, areas = mesh_io.face_normals(mesh)
    pairs = _of_triangles(edges, 2)
    first, second = pairs.T % count
    bend = 2 - np.abs((unit[first] * unit[second]).sum(axis=1))  # at least 1: what is 0 is no edge of a graph
    tree = csgraph.minimum_spanning_tree(sparse.coo_matrix((bend, (first, second)), (count, count))).tocoo()
    agree = sparse.coo_matrix((edges[pairs[:, 0], 0] != edges[pairs[:, 1], 0], (first, second)), (count, count))
    same = np.asarray(agree.tocsr()[tree.row, tree.col]).ravel()
    rows = np.concatenate([tree.row, tree.row + count])  # each triangle twice: as it is, and turned
    columns = np.concatenate([tree.col + count * ~same, tree.col + count * same])
    joined = sparse.coo_matrix((np.ones(len(rows), bool), (rows, columns)), (2 * count, 2 * count))
    as_is, turned = csgraph.connected_components(joined, directed=False)[1].reshape(2, count)
    back, sheet = as_is > turned, np.minimum(as_is, turned)
    middle, number = mesh.vertices[faces].mean(axis=1), np.maximum(np.bincount(sheet), 1)
    centre = np.stack([np.bincount(sheet, column) / number for column in middle.T], axis=1)
    high = ((middle - centre[sheet]) * unit).sum(axis=1) * areas
    back ^= np.bincount(sheet, np.where(back, -high, high))[sheet] < 0
    return mesh_io.Mesh(mesh.vertices, np.where(back[:, None], faces[:, ::-1], faces), mesh.remarks)


def _of_triangles(edges: Int[np.ndarray, "e 2"], number: int) -> Int[np.ndarray, "k number"]:
    """Indices of edges that so many triangles have, a row an edge."""
    keys = np.sort(edges, axis=1) @ np.array([edges.max(initial=0) + 1, 1])
    _, index, counts = np.unique(keys, return_inverse=True, return_counts=True)
    order = np.argsort(index, kind="stable")
    return order[np.repeat(counts, counts) == number].reshape(-1, number)


def _lids(mesh: mesh_io.Mesh) -> Int[np.ndarray, "k 3"]:
    """Triangles over the openings of `SMALL` edges or fewer that touch no other and are no outer rim of a speck."""
    loops, met = mesh_topology.opening_loops(mesh), np.zeros(len(mesh.vertices))
    for loop in loops:
        met[loop] += 1
    rings = [loop for loop in loops if len(loop) <= SMALL and met[loop].max() == 1]
    ring_of = np.full(len(mesh.vertices), -1)
    for i, ring in enumerate(rings):
        ring_of[ring] = i
    own = ring_of[mesh.faces]
    specks = set(own[(own == own[:, :1]).all(axis=1), 0].tolist())
    wanted = (ring.tolist() for i, ring in enumerate(rings) if i not in specks)
    lids = [(ring[0], *pair) for ring in wanted for pair in itertools.pairwise(ring[1:])]
    return np.array(lids, int).reshape(-1, 3)

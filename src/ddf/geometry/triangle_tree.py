"""A tree of boxes over triangles, in float64: the first triangle that rays meet, all that they meet, the nearest one.

The tree is complete: node k has the parts 2 k and 2 k + 1, and the leaves are its last level. Each level halves the
triangles of a box along the longest side of their middles' box.

A triangle is met as of Woop et al. 2013, "Watertight ray/triangle intersection": sheared edge functions, whose signs
agree between the triangles of an edge; zero counts as inside, so no ray slips between two triangles.

All in one file: numba keeps compiled code until the file changes, not until another does.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ddf.geometry.grid_loops import compiled

_LEAF = 4  # triangles of a leaf, at most
_DEEPEST = 64  # levels: 2^64 triangles
_LONG = 1e300  # in place of 1/0
_WIDER = 1 + 4 * float(np.finfo(np.float64).eps)  # of the end of a box. Source: Ize 2013, "Robust BVH ray traversal"


@dataclass(frozen=True)
class Tree:
    """boxes: least and greatest corner of each node. starts: of the leaves, in the order of the tree. order: the
    triangle at each place of it. corners: in it.
    """

    boxes: Float[np.ndarray, "nodes 6"]
    starts: Int[np.ndarray, "leaves"]
    order: Int[np.ndarray, "n"]
    corners: Float[np.ndarray, "n 3 3"]

    def first(
        self, positions: Float[np.ndarray, "k 3"], directions: Float[np.ndarray, "k 3"], enough: float = 0.0
    ) -> tuple[Float[np.ndarray, "k"], Int[np.ndarray, "k"]]:
        """Depth t >= 0, in lengths of the direction, and triangle of what rays meet first: `inf` and -1 on a miss.
        From the depth `enough` down any hit will do.
        """
        return _first(_rows(positions), _rows(directions), self.boxes, self.starts, self.order, self.corners, enough)

    def met(
        self, positions: Float[np.ndarray, "k 3"], directions: Float[np.ndarray, "k 3"]
    ) -> tuple[Int[np.ndarray, "m"], Int[np.ndarray, "m"], Float[np.ndarray, "m"]]:
        """Ray, triangle and depth of all that rays meet."""
        asked = _rows(positions), _rows(directions), self.boxes, self.starts, self.corners
        counts = np.zeros(len(positions), np.int64)
        _met(*asked, counts, np.zeros(0, np.int64), np.zeros(0))
        place, depth = np.zeros(counts.sum(), np.int64), np.zeros(counts.sum())
        _met(*asked, np.cumsum(counts) - counts, place, depth)
        return np.repeat(np.arange(len(counts)), counts), self.order[place], depth

    def closest(self, points: Float[np.ndarray, "k 3"]) -> Float[np.ndarray, "k 3"]:
        """The point of the triangles that is nearest to each."""
        return _closest(_rows(points), self.boxes, self.starts, self.corners)


def of(corners: Float[np.ndarray, "n 3 3"]) -> Tree:
    """The tree of triangles; of none, that of one that nothing meets."""
    corners = corners if len(corners) else np.full((1, 3, 3), np.nan)
    low, high = corners.min(axis=1), corners.max(axis=1)
    middle, order, starts, boxes = (low + high) / 2, np.arange(len(corners)), np.array([0, len(corners)]), []
    while True:
        begin = starts[:-1]
        boxes.append(np.hstack([np.minimum.reduceat(low[order], begin), np.maximum.reduceat(high[order], begin)]))
        if np.diff(starts).max() <= _LEAF:
            break
        placed = middle[order]
        spread = np.maximum.reduceat(placed, begin) - np.minimum.reduceat(placed, begin)
        node = np.repeat(np.arange(len(begin)), np.diff(starts))
        along = np.take_along_axis(placed, spread.argmax(axis=1)[node, None], axis=1)[:, 0]
        order = order[np.lexsort((along, node))]
        halves = np.stack([begin, (begin + starts[1:]) // 2], axis=1)
        starts = np.append(halves.reshape(-1), len(order))
    return Tree(np.concatenate([np.zeros((1, 6)), *boxes]), starts, order, np.ascontiguousarray(corners[order]))


def _rows(vectors: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(vectors, dtype=np.float64)


@compiled
def _span(boxes, node, start, inverse, most):
    """Where a ray enters a node and leaves it, in [0, most]; it passes by where the first is more."""
    enter, leave = 0.0, np.inf
    for axis in range(3):
        a, b = (boxes[node, axis] - start[axis]) * inverse[axis], (boxes[node, axis + 3] - start[axis]) * inverse[axis]
        enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    return enter, min(leave * _WIDER, most)


@compiled
def _prepared(direction):
    """1 / v, the axes with that of the largest part of v last, and shears."""
    vx, vy, vz = direction[0], direction[1], direction[2]
    inverse = 1 / vx if vx else _LONG, 1 / vy if vy else _LONG, 1 / vz if vz else _LONG
    z = 0
    for axis in range(1, 3):
        z = axis if abs(direction[axis]) > abs(direction[z]) else z
    x, y = (z + 1) % 3, (z + 2) % 3
    return inverse, (x, y, z), (direction[x] / direction[z], direction[y] / direction[z], 1 / direction[z])


@compiled
def _hit(corners, i, start, axes, shears):
    """Depth t >= 0 of a ray on a triangle; infinite where it passes by or lies in the plane."""
    x, y, z = axes
    az, bz, cz = corners[i, 0, z] - start[z], corners[i, 1, z] - start[z], corners[i, 2, z] - start[z]
    ax, ay = corners[i, 0, x] - start[x] - shears[0] * az, corners[i, 0, y] - start[y] - shears[1] * az
    bx, by = corners[i, 1, x] - start[x] - shears[0] * bz, corners[i, 1, y] - start[y] - shears[1] * bz
    cx, cy = corners[i, 2, x] - start[x] - shears[0] * cz, corners[i, 2, y] - start[y] - shears[1] * cz
    u, v, w = cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax
    total = u + v + w
    if (min(u, v, w) < 0 and max(u, v, w) > 0) or total == 0:
        return np.inf
    depth = (u * az + v * bz + w * cz) / total * shears[2]
    return depth if depth >= 0 else np.inf


@compiled
def _first(positions, directions, boxes, starts, order, corners, enough):
    """As `Tree.first`."""
    depths, faces = np.full(len(positions), np.inf), np.full(len(positions), -1)
    nodes, enters, leaves = np.zeros(_DEEPEST, np.int64), np.zeros(_DEEPEST), len(starts) - 1
    for ray in range(len(positions)):
        start = positions[ray, 0], positions[ray, 1], positions[ray, 2]
        inverse, axes, shears = _prepared(directions[ray])
        best, face, waiting = np.inf, -1, 1
        nodes[0], enters[0] = 1, 0.0
        while waiting > 0 and (face < 0 or best > enough):
            waiting -= 1
            node = nodes[waiting] if enters[waiting] <= best else 0
            while 0 < node < leaves:
                node *= 2
                near, end = _span(boxes, node, start, inverse, best)
                far, far_end = _span(boxes, node + 1, start, inverse, best)
                first, second = near <= end, far <= far_end
                if first and second:
                    later = 1 if near <= far else 0
                    nodes[waiting], enters[waiting] = node + later, max(near, far)
                    waiting, node = waiting + 1, node + 1 - later
                else:
                    node = node if first else node + 1 if second else 0
            for i in range(starts[node - leaves] if node else 0, starts[node - leaves + 1] if node else 0):
                depth = _hit(corners, i, start, axes, shears)
                if depth < best or (depth == best and depth < np.inf and order[i] < face):
                    best, face = depth, order[i]
        depths[ray], faces[ray] = best, face
    return depths, faces


@compiled
def _met(positions, directions, boxes, starts, corners, places, found, depths):
    """As `Tree.met`: their number, in places, or with room for them, which; places is where each ray's begin."""
    nodes, leaves, counted = np.zeros(_DEEPEST, np.int64), len(starts) - 1, len(found) == 0
    for ray in range(len(positions)):
        start = positions[ray, 0], positions[ray, 1], positions[ray, 2]
        inverse, axes, shears = _prepared(directions[ray])
        nodes[0], waiting = 1, 1
        while waiting > 0:
            waiting -= 1
            node = nodes[waiting]
            enter, leave = _span(boxes, node, start, inverse, np.inf)
            if enter <= leave and node < leaves:
                nodes[waiting], nodes[waiting + 1] = 2 * node, 2 * node + 1
                waiting += 2
            elif enter <= leave:
                for i in range(starts[node - leaves], starts[node - leaves + 1]):
                    depth = _hit(corners, i, start, axes, shears)
                    if depth < np.inf:
                        if not counted:
                            found[places[ray]], depths[places[ray]] = i, depth
                        places[ray] += 1


@compiled
def _apart(boxes, node, point):
    """Squared distance of a point from a node."""
    total = 0.0
    for axis in range(3):
        beyond = max(boxes[node, axis] - point[axis], point[axis] - boxes[node, axis + 3], 0.0)
        total += beyond * beyond
    return total


@compiled
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _along(a, b):
    """The multiple of a, from 0 to 1, that is nearest to b."""
    length = _dot(a, a)
    return min(max(_dot(a, b) / length, 0.0), 1.0) if length > 0 else 0.0


@compiled
def _nearest(corners, i, point):
    """Offset from a point to the nearest of a triangle: the foot on its plane if that lies inside, else on an edge."""
    a = corners[i, 0, 0] - point[0], corners[i, 0, 1] - point[1], corners[i, 0, 2] - point[2]
    b = corners[i, 1, 0] - point[0], corners[i, 1, 1] - point[1], corners[i, 1, 2] - point[2]
    c = corners[i, 2, 0] - point[0], corners[i, 2, 1] - point[1], corners[i, 2, 2] - point[2]
    ab, ac = (b[0] - a[0], b[1] - a[1], b[2] - a[2]), (c[0] - a[0], c[1] - a[1], c[2] - a[2])
    normal = _cross(ab, ac)
    square, best, foot = _dot(normal, normal), np.inf, a
    inside = square > 0
    for p, q in ((a, b), (b, c), (c, a)):
        inside = inside and _dot(normal, _cross(p, q)) >= 0
    if inside:
        height = _dot(normal, a) / square
        return height * normal[0], height * normal[1], height * normal[2]
    for p, q in ((a, b), (b, c), (c, a)):
        edge = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        share = _along(edge, (-p[0], -p[1], -p[2]))
        other = p[0] + share * edge[0], p[1] + share * edge[1], p[2] + share * edge[2]
        if _dot(other, other) < best:
            best, foot = _dot(other, other), other
    return foot


@compiled
def _closest(points, boxes, starts, corners):
    """As `Tree.closest`."""
    out = np.zeros_like(points)
    nodes, aparts, leaves = np.zeros(_DEEPEST, np.int64), np.zeros(_DEEPEST), len(starts) - 1
    for row in range(len(points)):
        point, best, waiting = (points[row, 0], points[row, 1], points[row, 2]), np.inf, 1
        nodes[0], aparts[0] = 1, 0.0
        while waiting > 0:
            waiting -= 1
            node = nodes[waiting] if aparts[waiting] < best else 0
            while 0 < node < leaves:
                node *= 2
                first, second = _apart(boxes, node, point), _apart(boxes, node + 1, point)
                later = 1 if first <= second else 0
                if max(first, second) < best:
                    nodes[waiting], aparts[waiting] = node + later, max(first, second)
                    waiting += 1
                node = node + 1 - later if min(first, second) < best else 0
            for i in range(starts[node - leaves] if node else 0, starts[node - leaves + 1] if node else 0):
                foot = _nearest(corners, i, point)
                if _dot(foot, foot) < best:
                    best = _dot(foot, foot)
                    out[row, 0], out[row, 1], out[row, 2] = point[0] + foot[0], point[1] + foot[1], point[2] + foot[2]
    return out
